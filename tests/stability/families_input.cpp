#include "core/builtin_scenes.h"
#include "tests/stability/comparison.h"
#include "tests/stability/family.h"
#include "tests/stability/scenes_light.h"
#include "tests/stability/seeds.h"
#include "tests/support/surface_samples.h"
#include "transport/measures.h"

#include <algorithm>
#include <cmath>
#include <utility>

// Input that should not matter: units and places, triangles and their winding, normals, faces too
// many or crossing; and input that is incomplete. Results are compared with those of the room as it
// is built, where nothing else is said.

namespace afterglow {
namespace {

constexpr int seeds = 6;
Setting room(const Scene& scene = make_room()) {
    Setting setting{scene, room_lights(), {}};
    const Scene plain = make_room();
    const Surface surface(plain);
    setting.places = points_in_sight(surface, eye_in_room, 500, 5);
    return setting;
}

/// Of the room as it is built.
const OfSeeds& base() {
    static const OfSeeds results = indirect_of_seeds(room(), 1, seeds);
    return results;
}

std::vector<Figure> difference_figures(const Setting& setting) {
    const Difference d = difference(base(), indirect_of_seeds(setting, 1, seeds));
    return {{"difference [standard errors]", d.in_errors()},
            percent("difference", d.size),
            percent("standard error", d.standard_error),
            percent("bias", d.bias)};
}

/// In millimetres, so that the unit is what is left of the coordinates' digits.
std::vector<Figure> shift(double extents) {
    const auto by = static_cast<float>(extents * 5000.0);
    return difference_figures(shifted(scaled(room(), 1000.0f), Vec3(by, -by, by)));
}

std::vector<Figure> splits(double times) {
    Scene scene = make_room();
    for (int k = 0; k < static_cast<int>(times); ++k)
        scene = split_in_four(scene);
    return difference_figures(room(scene));
}

/// A family of scenes made from the room's, whose dial is the share of its triangles so treated.
template <class Transformation>
Family by_share(const std::string& name, const std::string& treated,
                const Transformation& transformation) {
    return {name, "share of triangles " + treated, {0.5, 1.0}, [transformation](double share) {
                return difference_figures(
                    room(transformation(make_room(), static_cast<float>(share))));
            }};
}

std::vector<Figure> error_figures(Scene scene) {
    const Precomputed precomputed(std::move(scene));
    const Comparison c = compare(precomputed, room_lights().front(),
                                 points_in_sight(precomputed.surface(), eye_in_room, 500, 5));
    const Measures m = measure(c.indirect, c.reference);
    return {percent("relRMSE", c.rel_rmse()), percent("bias", c.bias()), percent("p99", m.p99),
            percent("reference error", c.reference_error())};
}

/// A window as high as the room in the wall x = 5 ...
std::vector<Figure> window(double share) {
    return error_figures(make_room({.open = {0, static_cast<float>(share), 0, 0, 0}}));
}

/// ... and without the first few of the walls, the ceiling last.
std::vector<Figure> missing_walls(double count) {
    RoomShape shape;
    for (int k = 0; k < static_cast<int>(count); ++k)
        shape.open[static_cast<std::size_t>(k)] = 1.0f;
    return error_figures(make_room(shape));
}

/// Standard deviation over seeds.
double deviation(const Eigen::ArrayXd& of_seed) {
    return std::sqrt((of_seed - of_seed.mean()).square().sum()
                     / (static_cast<double>(of_seed.size()) - 1.0));
}

/// Mean and spread over seeds of the error, without the reference's variance in relRMSE.
std::vector<Figure> spread(const Scene& scene, const Vec3& eye, const Spotlight& light, int count) {
    Setting setting{scene, {light}, {}};
    const Surface surface(setting.scene);
    setting.places = points_in_sight(surface, eye, 1000, 5);
    PathTracerOptions tracer;
    tracer.target_error = 0.01;
    tracer.seed = 17;
    tracer.strategy = PathStrategy::connected;
    const IrradianceEstimate reference =
        estimate_irradiance(surface, {&light, 1}, setting.places, tracer);
    const double reference_error = reference.relative_error.front();
    const OfSeeds results = indirect_of_seeds(setting, 1, count);
    Eigen::ArrayXd rel_rmse(count), rel_l1(count), bias(count);
    for (int k = 0; k < count; ++k) {
        const Measures m = measure(results[static_cast<std::size_t>(k)], reference.indirect);
        rel_rmse[k] =
            std::sqrt(std::max(0.0, std::pow(m.rel_rmse, 2) - std::pow(reference_error, 2)));
        rel_l1[k] = m.rel_l1;
        bias[k] = m.bias;
    }
    return {percent("relRMSE", rel_rmse.mean()),
            percent("its deviation over it", deviation(rel_rmse) / rel_rmse.mean()),
            percent("largest relRMSE", rel_rmse.maxCoeff()),
            percent("relL1", rel_l1.mean()),
            percent("its deviation over it", deviation(rel_l1) / rel_l1.mean()),
            percent("bias", bias.mean()),
            percent("its deviation", deviation(bias)),
            percent("reference error", reference_error)};
}

} // namespace

std::vector<Family> input_families() {
    return {
        {"scale",
         "factor of all coordinates",
         {1e-3, 1e-2, 10, 1e3, 1e5},
         [](double f) { return difference_figures(scaled(room(), static_cast<float>(f))); }},
        {"shift", "shift [sizes of the scene]", {2, 20, 200, 2000, 20000}, shift},
        {"diagonals",
         "the other diagonals",
         {1},
         [](double) { return difference_figures(room(with_other_diagonals(make_room()))); }},
        {"splits", "times that triangles are cut in four", {1, 2, 3, 4}, splits},
        by_share("t_junctions", "cut in two", with_t_junctions),
        by_share("duplicated", "that are there twice", duplicated),
        by_share("coplanar", "with another in their plane", with_coplanar_faces),
        by_share("flipped", "wound the other way", flipped),
        by_share("normals", "that have normals",
                 [](const Scene& s, float share) { return with_flat_normals(s, 1.0f, share); }),
        by_share("flipped_normals", "with normals the wrong way",
                 [](const Scene& s, float share) { return with_flat_normals(s, -1.0f, share); }),
        {"overhang",
         "how far walls go on beyond each other [m]",
         {0.001, 0.1, 2},
         [](double o) {
             return difference_figures(room(make_room({.overhang = static_cast<float>(o)})));
         }},
        {"sunken",
         "how deep furniture is in the floor [m]",
         {0.001, 0.1, 2},
         [](double s) {
             return difference_figures(room(make_room({.sunken = static_cast<float>(s)})));
         }},
        {"window", "open share of a wall", {0, 0.1, 0.5, 1}, window},
        {"missing_walls", "walls missing", {1, 2, 3, 4, 5}, missing_walls},
        {"seeds_cornell",
         "seeds",
         {10},
         [](double count) {
             Spotlight light{.position = Vec3(0.278f, 0.54f, 0.2795f),
                             .inner_angle = 40.0f,
                             .outer_angle = 45.0f};
             light.check();
             return spread(make_builtin_scene("builtin:cornell"), Vec3(0.278f, 0.273f, 0.03f),
                           light, static_cast<int>(count));
         }},
        {"seeds_two_rooms",
         "seeds",
         {10},
         [](double count) {
             Spotlight light{.position = Vec3(2.0f, 2.7f, 2.0f),
                             .direction = Vec3(0.1f, -1.0f, 0.0f),
                             .inner_angle = 40.0f,
                             .outer_angle = 45.0f};
             light.check();
             return spread(make_builtin_scene("builtin:two_rooms"), Vec3(0.5f, 1.5f, 0.6f), light,
                           static_cast<int>(count));
         }},
        {"seeds_room", "seeds", {10}, [](double count) {
             return spread(make_room(), eye_in_room, room_lights().front(),
                           static_cast<int>(count));
         }}};
}

} // namespace afterglow
