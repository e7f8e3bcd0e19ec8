#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/bench/accuracy_points.h"
#include "tests/stability/comparison.h"
#include "tests/stability/family.h"
#include "tests/stability/flicker.h"
#include "tests/stability/ringing.h"
#include "tests/stability/scenes_light.h"
#include "tests/support/surface_samples.h"
#include "transport/measures.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

// Lights that the method finds hard: hard edges, small bright spots, motion, bright rooms.

namespace afterglow {
namespace {

/// A scene with its operator, and the places that are looked at.
struct Prepared {
    Precomputed precomputed;
    std::vector<SurfacePoint> places;

    Prepared(Scene scene, const Vec3& eye, int rays)
        : precomputed(std::move(scene)),
          places(points_in_sight(precomputed.surface(), eye, rays, 5)) {}

    Ringing ringing(const Spotlight& light) const {
        return ringing_of(
            unclamped_irradiance(precomputed.surface(), precomputed.transfer(), light, places));
    }
};

/// The furnished room, made when it is first asked for.
const Prepared& furnished() {
    static const Prepared room(make_room(), eye_in_room, 500);
    return room;
}

std::vector<Figure> ringing_figures(const Ringing& r) {
    return {percent("negative share", r.negative_share), percent("negative size", r.largest)};
}

std::vector<Figure> error_figures(const Prepared& scene, const Spotlight& light) {
    const Comparison c = compare(scene.precomputed, light, scene.places);
    const Measures m = measure(c.indirect, c.reference);
    std::vector<Figure> figures = {percent("relRMSE", c.rel_rmse()), percent("bias", c.bias()),
                                   percent("median", m.median), percent("p99", m.p99),
                                   percent("reference error", c.reference_error())};
    for (const Figure& f : ringing_figures(scene.ringing(light)))
        figures.push_back(f);
    return figures;
}

Spotlight spot(const Vec3& position, const Vec3& direction, float inner, float outer) {
    Spotlight light{
        .position = position, .direction = direction, .inner_angle = inner, .outer_angle = outer};
    light.check();
    return light;
}

// Ringing. Where much light bounces about, it lifts what rings above zero: dark rooms show it.

constexpr float dark = 0.1f; // reflectance

/// A thin square board in the air of the room, `shift` m from the place under the light, throws a
/// shadow with a hard edge onto the floor.
std::vector<Figure> ringing_of_board(float reflectance, float side, float shift) {
    Scene scene = make_room();
    add_board(scene, Vec3(2.5f - shift, 1.2f, 2.0f), side);
    for (Material& material : scene.materials)
        material.reflectance.setConstant(reflectance);
    const Prepared room(std::move(scene), eye_in_room, 5000);
    return ringing_figures(room.ringing(spot({2.5f, 2.6f, 2.0f}, -Vec3::UnitY(), 30.0f, 30.0f)));
}

float coarse_radius() {
    return static_cast<float>(furnished().precomputed.coarse_radius());
}

/// A hard spot low in the Cornell box, that lights floor and walls beside the tall block.
std::vector<Figure> ringing_of_spot(double half_angle) {
    static const Prepared cornell(make_builtin_scene("builtin:cornell"),
                                  Vec3(0.278f, 0.273f, 0.03f), 5000);
    const auto angle = static_cast<float>(half_angle);
    return ringing_figures(
        cornell.ringing(spot({0.05f, 0.08f, 0.4f}, {0.2f, -0.4f, -0.9f}, angle, angle)));
}

/// The same in a corner of the first of two rooms, seen from both.
std::vector<Figure> ringing_in_two_rooms(double reflectance) {
    Scene scene = make_builtin_scene("builtin:two_rooms");
    for (Material& material : scene.materials)
        material.reflectance.setConstant(static_cast<float>(reflectance));
    Prepared rooms(std::move(scene), Vec3(2.0f, 1.4f, 2.0f), 2500);
    for (const SurfacePoint& x :
         points_in_sight(rooms.precomputed.surface(), Vec3(6.0f, 1.4f, 2.0f), 2500, 5))
        rooms.places.push_back(x);
    return ringing_figures(
        rooms.ringing(spot({1.0f, 0.84f, 3.3f}, {-0.47f, -0.64f, 0.6f}, 23.0f, 23.0f)));
}

// Small bright spots.

std::vector<Figure> tight_spot(double half_angle) {
    const auto outer = static_cast<float>(half_angle);
    return error_figures(furnished(),
                         spot({2.3f, 2.6f, 2.2f}, {-0.1f, -1.0f, 0.05f}, 0.9f * outer, outer));
}

std::vector<Figure> near_wall(double distance, const Vec3& direction) {
    return error_figures(furnished(),
                         spot({2.0f, 1.5f, static_cast<float>(distance)}, direction, 50.0f, 60.0f));
}

// Motion.

std::vector<Figure> flicker_figures(const Flicker& f) {
    return {percent("rms beyond", f.net_rms()), percent("p95 beyond", f.p95),
            percent("largest beyond", f.largest), percent("reference noise", f.noise),
            percent("true change", f.change), {"largest jump over the true one", f.jump_ratio}};
}

/// Six frames of a light that moves by so many spacings of the finest senders a frame.
std::vector<Figure> flicker(double step) {
    constexpr int count = 6;
    const Precomputed& room = furnished().precomputed;
    const float spacing = room.transfer().points.spacing[room.transfer().sender_levels - 1];
    std::vector<Spotlight> frames;
    for (int f = 0; f < count; ++f) {
        const float way = static_cast<float>(step) * spacing
                          * (static_cast<float>(f) - 0.5f * static_cast<float>(count - 1));
        frames.push_back(spot(Vec3(2.5f, 2.6f, 2.0f) + way * Vec3(1.0f, 0.0f, 0.3f).normalized(),
                              {0.1f, -1.0f, -0.1f}, 40.0f, 45.0f));
    }
    const Camera camera{.position = Vec3(4.7f, 1.7f, 3.7f),
                        .target = Vec3(1.5f, 0.8f, 1.2f),
                        .up = Vec3::UnitY(),
                        .vertical_fov = 60.0f,
                        .width = 96,
                        .height = 64};
    const Flicker f = measure_flicker(room.surface(), room.transfer(), frames, camera);
    return flicker_figures(f);
}

// Bright scenes.

/// Scales all reflectances, textures included, by one factor, so that their mean over what is seen
/// from `eye` would be `mean`; none exceeds 0.99. Returns the mean that they have then.
double set_mean_reflectance(Scene& scene, const Vec3& eye, float mean) {
    constexpr float most = 0.99f;
    const Surface surface(scene); // sees the reflectances that the scene has when it is asked
    const auto mean_in_sight = [&] {
        double sum = 0.0;
        int count = 0;
        for (std::uint32_t k = 0; k < 4096; ++k)
            if (const Hit hit = surface.closest_hit({eye, sample_sphere(scrambled_sobol2(k, 3))})) {
                sum += surface.reflectance(hit).mean();
                ++count;
            }
        return sum / count;
    };
    const float factor = mean / static_cast<float>(mean_in_sight());
    for (Material& material : scene.materials) {
        if (material.texture == no_index) {
            material.reflectance = (factor * material.reflectance).min(most);
            continue;
        }
        // A texture of its own, as what is cut off depends on the product.
        Texture texture = scene.textures[material.texture];
        for (std::size_t k = 0; k < texture.rgb.size(); ++k)
            texture.rgb[k] = std::min(most, factor * material.reflectance[static_cast<Index>(k % 3)]
                                                * texture.rgb[k]);
        material.reflectance = Rgb::Ones();
        material.texture = static_cast<std::uint32_t>(scene.textures.size());
        scene.textures.push_back(std::move(texture));
    }
    return mean_in_sight();
}

std::vector<Figure> bright_sponza(double mean) {
    const AccuracyScene described =
        find_accuracy_scene("sponza", std::getenv("AFTERGLOW_SCENES"), AFTERGLOW_LIGHTS);
    Scene scene = load_scene(described.path);
    const double reached =
        set_mean_reflectance(scene, described.viewpoint, static_cast<float>(mean));
    const Prepared sponza(std::move(scene), described.viewpoint, 400);
    std::vector<Figure> figures = error_figures(sponza, described.lights[0]);
    figures.push_back({"mean reached", reached});
    return figures;
}

/// The light of Sponza walks along the nave for 200 frames, so many metres a frame.
std::vector<Figure> walk_sponza(double step) {
    const AccuracyScene described =
        find_accuracy_scene("sponza", std::getenv("AFTERGLOW_SCENES"), AFTERGLOW_LIGHTS);
    const Prepared sponza(load_scene(described.path), described.viewpoint, 400);
    std::vector<Spotlight> frames(200, described.lights[0]);
    for (std::size_t f = 0; f < frames.size(); ++f)
        frames[f].position.x() += static_cast<float>(step) * static_cast<float>(f);
    const Camera camera{.position = Vec3(-10.0f, 2.0f, 0.0f),
                        .target = Vec3(-9.0f, 1.9f, 0.0f),
                        .up = Vec3::UnitY(),
                        .vertical_fov = 45.0f,
                        .width = 96,
                        .height = 64};
    const Precomputed& precomputed = sponza.precomputed;
    return flicker_figures(measure_flicker(precomputed.surface(), precomputed.transfer(), frames, camera,
                                           {.runs = 4, .samples_per_run = 8}));
}

} // namespace

std::vector<Family> light_families() {
    std::vector<Family> families = {
        {"ringing_reflectance",
         "reflectance of the room",
         {0.01, 0.05, 0.1, 0.2, 0.4, 0.7},
         [](double rho) { return ringing_of_board(static_cast<float>(rho), 1.0f, 0.0f); }},
        {"ringing_edge",
         "shift of a shadow [coarsest spacings]",
         {0.0, 0.125, 0.25, 0.375, 0.5},
         [](double shift) {
             return ringing_of_board(dark, 1.0f, static_cast<float>(shift) * coarse_radius());
         }},
        {"ringing_blocker",
         "side of a blocker [coarsest spacings]",
         {0.01, 0.03, 0.1, 0.2, 0.4, 0.8},
         [](double side) {
             return ringing_of_board(dark, static_cast<float>(side) * coarse_radius(), 0.0f);
         }},
        {"ringing_spot",
         "half-angle of a spotlight [degrees]",
         {5, 10, 15, 20, 30, 45},
         ringing_of_spot},
        {"ringing_two_rooms",
         "reflectance of the rooms",
         {0.01, 0.05, 0.1, 0.2, 0.4, 0.7},
         ringing_in_two_rooms},
        {"tight_spot",
         "half-angle of a spotlight [degrees]",
         {1, 2, 5, 10, 20, 45, 90},
         tight_spot},
        {"light_at_wall",
         "distance of a light that shines at a wall [m]",
         {0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1},
         [](double distance) { return near_wall(distance, -Vec3::UnitZ()); }},
        {"light_along_wall",
         "distance of a light that shines along a wall [m]",
         {0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1},
         [](double distance) { return near_wall(distance, Vec3::UnitX()); }},
        {"flicker", "step of a light [spacings of the finest senders]", {0.1, 0.3, 1, 3}, flicker}};
    if (std::getenv("AFTERGLOW_SCENES")) {
        families.push_back(
            {"bright_sponza", "mean reflectance", {0.25, 0.5, 0.9, 0.99}, bright_sponza});
        families.push_back({"walk_sponza", "step of a light [m]", {0.01}, walk_sponza});
    }
    return families;
}

} // namespace afterglow
