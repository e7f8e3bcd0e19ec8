#include "core/builtin_scenes.h"
#include "tests/stability/comparison.h"
#include "tests/stability/family.h"
#include "tests/stability/scenes.h"
#include "tests/support/surface_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

namespace afterglow {
namespace {

using Figures = std::vector<Figure>;
using Places = std::vector<SurfacePoint>;

constexpr int rays = 400; // that look for places

Places in_view(const Precomputed& room, int count = rays) {
    return points_in_sight(room.surface(), *room.scene().viewpoint, count, 1);
}

/// `count` places on several quads, in equal numbers.
Places places_on_all(const std::vector<Quad>& quads, int count) {
    Places places;
    const int each = std::max(1, count / static_cast<int>(quads.size()));
    for (std::size_t k = 0; k < quads.size(); ++k) {
        const Places more = places_on(quads[k], each, k);
        places.insert(places.end(), more.begin(), more.end());
    }
    return places;
}

/// Error relative to the places' own mean, bias, and the reference's error.
void append(Figures& figures, const std::string& where, const Comparison& comparison) {
    figures.push_back(percent(where + " relRMSE", comparison.rel_rmse()));
    figures.push_back(percent("bias", comparison.bias()));
    figures.push_back(percent("reference", comparison.reference_error()));
}

double largest(const Eigen::Array3Xf& irradiance) {
    return irradiance.colwise().mean().maxCoeff();
}

// Two rooms. -------------------------------------------------------------------------------------

constexpr float rooms_radius = 3.0f; // R of two rooms, near enough [m]
constexpr float rooms_length = 4.0f; // of each along x [m]

Vec3 middle_of_dark_room(float wall) {
    return {1.5f * rooms_length + wall, 1.4f, 2.0f};
}

/// Places that are seen from the middle of the dark room and lie in it, not beyond the door.
Places in_dark_room(const Surface& surface, float wall, int count) {
    Places places = points_in_sight(surface, middle_of_dark_room(wall), count, 2);
    std::erase_if(places, [&](const SurfacePoint& x) {
        return x.position.x() < rooms_length + wall - 1e-4f;
    });
    return places;
}

Figures measure_door(float wall, float door_width) {
    LitScene lit = two_rooms(wall, door_width);
    const Precomputed rooms(std::move(lit.scene));
    Figures figures{{"R [m]", rooms.coarse_radius()}};
    append(figures, "dark", compare(rooms, lit.light, in_dark_room(rooms.surface(), wall, rays)));
    append(figures, "lit", compare(rooms, lit.light, in_view(rooms), 0.01));
    return figures;
}

/// Places all over the dark room, and in strips of 1 cm along the wall that parts the rooms.
Places along_dark_wall_and_room(const Surface& surface, float wall) {
    Places places = in_dark_room(surface, wall, 20000);
    const float x = rooms_length + wall, strip = 0.01f;
    const Vec3 across(0, 0, 4), up(0, 2.8f, 0);
    const Quad strips[] = {{{x, 0, 0}, across, {strip, 0, 0}},
                           {{x, 2.8f, 0}, {strip, 0, 0}, across},
                           {{x, 0, 0}, {0, strip, 0}, across},
                           {{x, 0, 0}, {strip, 0, 0}, up},
                           {{x, 0, 4}, up, {strip, 0, 0}}};
    for (const Quad& quad : strips) {
        const Places more = places_on(quad, 500, 3);
        places.insert(places.end(), more.begin(), more.end());
    }
    return places;
}

Figures measure_closed_wall(double percent_of_radius, Shell shell) {
    const float wall = static_cast<float>(percent_of_radius) / 100.0f * rooms_radius;
    LitScene lit = two_rooms(wall, 0.0f, shell);
    const Precomputed rooms(std::move(lit.scene));
    const Eigen::Array3Xf dark =
        rooms.indirect(lit.light, along_dark_wall_and_room(rooms.surface(), wall));
    const double lit_mean = rooms.indirect(lit.light, in_view(rooms)).mean();
    return {{"R [m]", rooms.coarse_radius()},
            percent("largest in the dark / lit mean", largest(dark) / lit_mean),
            percent("mean in the dark / lit mean", dark.mean() / lit_mean)};
}

// Parallel surfaces. -----------------------------------------------------------------------------

Figures measure_sheet(float side, float distance) {
    LitScene lit = sheet_above_floor(side, distance);
    const Precomputed room(std::move(lit.scene));
    const double scene_mean = compare(room, lit.light, in_view(room)).reference_mean();
    const Places covered = places_on_all(covered_by_sheet(side, distance), 500);
    const Comparison both = compare(room, lit.light, covered);
    const auto half = static_cast<Index>(covered.size() / 2);
    Figures figures{{"distance / R", distance / room.coarse_radius()}};
    append(figures, "covered", both);
    figures.push_back(percent("floor relRMSE", both.part(0, half).rel_rmse()));
    figures.push_back(percent("underside relRMSE", both.part(half, half).rel_rmse()));
    figures.push_back(percent("of the scene's mean", both.rel_rmse(scene_mean)));
    figures.push_back(percent("covered / scene's mean", both.reference_mean() / scene_mean));
    return figures;
}

/// Some places of a scene, and what is seen from its viewpoint.
Figures measure_places(LitScene lit, const std::string& where, const Places& places) {
    const Precomputed room(std::move(lit.scene));
    const Comparison all = compare(room, lit.light, in_view(room));
    const Comparison some = compare(room, lit.light, places);
    Figures figures{{"points", static_cast<double>(room.transfer().points.size())}};
    append(figures, where, some);
    figures.push_back(percent("of the scene's mean", some.rel_rmse(all.reference_mean())));
    append(figures, "view", all);
    return figures;
}

Figures measure_shelves(double gap) {
    const auto g = static_cast<float>(gap);
    return measure_places(shelves(g), "gaps", places_on_all(shelf_gaps(g), 500));
}

Figures measure_stairs(double rise) {
    const auto r = static_cast<float>(rise);
    return measure_places(stairs(r), "steps", places_on_all(stair_steps(r), 500));
}

// Closed spaces. ---------------------------------------------------------------------------------

/// What leaks into the closed part of a scene, or out of it, relative to the reference's mean where
/// the light is; and the error there.
Figures measure_leak(LitScene lit, const Vec3& outside, const Vec3& inside, LightAt light) {
    const Precomputed room(std::move(lit.scene));
    const auto seen_from = [&](LightAt place, int count) {
        return points_in_sight(room.surface(), place == LightAt::inside ? inside : outside, count,
                               2);
    };
    const LightAt dark_place = light == LightAt::inside ? LightAt::outside : LightAt::inside;
    const Eigen::Array3Xf dark = room.indirect(lit.light, seen_from(dark_place, 20000));
    const Comparison bright = compare(room, lit.light, seen_from(light, rays));
    Figures figures{
        {"points", static_cast<double>(room.transfer().points.size())},
        percent("largest in the dark / lit mean", largest(dark) / bright.reference_mean()),
        percent("mean in the dark / lit mean", dark.mean() / bright.reference_mean())};
    append(figures, "lit", bright);
    return figures;
}

Figures measure_closed_corner(double wall, LightAt light) {
    return measure_leak(closed_corner(static_cast<float>(wall), light), {2.5f, 1.4f, 2.0f},
                        {0.5f, 1.4f, 0.5f}, light);
}

Figures measure_closed_box(double wall, LightAt light) {
    return measure_leak(box_in_room(static_cast<float>(wall), true, light), {1.0f, 2.5f, 1.0f},
                        Vec3::Constant(2.5f), light);
}

Figures measure_open_box(double wall) {
    return measure_places(box_in_room(static_cast<float>(wall), false, LightAt::outside), "inside",
                          places_on_all(inside_of_box(), 500));
}

// Furnaces. --------------------------------------------------------------------------------------

std::string with_reflectance(const std::string& scene, double rho) {
    return "builtin:" + scene + ":" + std::to_string(rho);
}

/// In the box the mean is known: all bounces together bring rho / (1 - rho) of the direct light,
/// which is a sixth of the light's 4 pi I for each of the six faces of 4 m^2. In the sphere, lit
/// from its middle, so is every point.
Figures measure_furnace(double rho) {
    const double series = rho / (1.0 - rho), pi = EIGEN_PI;
    const Spotlight everywhere{
        .position = Vec3(-0.3f, 0.4f, 0.1f), .inner_angle = 180.0f, .outer_angle = 180.0f};
    const Precomputed box(make_builtin_scene(with_reflectance("furnace", rho)));
    const double box_mean =
        box.indirect(everywhere, points_by_area(box.scene(), 20000, 3)).cast<double>().mean();
    const Comparison in_box = compare(box, everywhere, points_by_area(box.scene(), 300, 4), 0.01);

    const Spotlight in_the_middle{.inner_angle = 180.0f, .outer_angle = 180.0f};
    const Precomputed sphere(make_builtin_scene(with_reflectance("sphere", rho)));
    const Eigen::Array3Xd in_sphere =
        sphere.indirect(in_the_middle, points_by_area(sphere.scene(), 2000, 3)).cast<double>();
    return {percent("box, mean - exact", box_mean / (series * 4.0 * pi / 24.0) - 1.0),
            percent("box relRMSE", in_box.rel_rmse()),
            percent("reference", in_box.reference_error()),
            percent("sphere, mean - exact", in_sphere.mean() / series - 1.0),
            percent("sphere relRMSE", std::sqrt((in_sphere / series - 1.0).square().mean()))};
}

// Small things. ----------------------------------------------------------------------------------

/// Those places of a room that lie on its shell, or those that do not.
Places split_off(const Places& places, const Vec3& room_size, bool on_shell) {
    Places chosen;
    std::ranges::copy_if(places, std::back_inserter(chosen), [&](const SurfacePoint& x) {
        const Vec3 from_low = x.position, from_high = room_size - x.position;
        return (from_low.cwiseMin(from_high).minCoeff() < 1e-3f) == on_shell;
    });
    return chosen;
}

/// The shell of a room of 5 x 2.8 x 4 m, and what is inside.
Figures measure_contents(LitScene lit) {
    const Vec3 room_size(5.0f, 2.8f, 4.0f);
    const Precomputed room(std::move(lit.scene));
    Figures figures{{"points", static_cast<double>(room.transfer().points.size())}};
    const Places places = in_view(room, 3 * rays);
    append(figures, "shell", compare(room, lit.light, split_off(places, room_size, true)));
    append(figures, "contents", compare(room, lit.light, split_off(places, room_size, false)));
    return figures;
}

Figures measure_clutter(double count) {
    return measure_contents(clutter(static_cast<int>(count), 10.0f, 5));
}

Figures measure_wires(double thickness) {
    LitScene lit = wires(static_cast<float>(thickness));
    const Precomputed room(std::move(lit.scene));
    Figures figures{{"points", static_cast<double>(room.transfer().points.size())}};
    append(figures, "view", compare(room, lit.light, in_view(room, 2 * rays)));
    return figures;
}

/// Sections as long as wide. Far from the light the reference is noisy at each place, but known in
/// the mean.
Figures measure_corridor(double length_over_width) {
    constexpr float width = 2.0f;
    const float length = width * static_cast<float>(length_over_width);
    LitScene lit = corridor(length);
    const Precomputed hall(std::move(lit.scene));
    Figures figures{{"R [m]", hall.coarse_radius()}};
    std::vector<double> mean;
    for (const auto& [name, from] :
         {std::pair("last", length - width), std::pair("middle", 0.5f * (length - width)),
          std::pair("first", 0.0f)}) {
        const std::vector<Quad> walls = corridor_section(length, from, from + width);
        const Comparison section = compare(hall, lit.light, places_on_all(walls, 300));
        append(figures, name, section);
        figures.push_back(percent("bias's error", section.bias_error()));
        mean.push_back(section.reference_mean());
    }
    figures.push_back({"last / first", mean.front() / mean.back()});
    return figures;
}

/// With the viewpoint that precomputation finds, and with the scene's own.
Figures measure_grains(double ground) {
    const LitScene lit = grains_on_ground(static_cast<float>(ground));
    Figures figures;
    for (const bool is_given : {false, true}) {
        PrecomputeOptions options;
        if (is_given) options.viewpoint = lit.scene.viewpoint;
        const Precomputed box(lit.scene, options);
        Places places;
        std::ranges::copy_if(in_view(box, 2 * rays), std::back_inserter(places),
                             [](const SurfacePoint& x) { return x.position.z() < 1.0f; });
        append(figures, is_given ? "given" : "found", compare(box, lit.light, places));
        figures.push_back({"R [m]", box.coarse_radius()});
    }
    return figures;
}

/// Looked at from a place this far above the floor of the Cornell box.
Figures measure_viewpoint(double height) {
    PrecomputeOptions options;
    options.viewpoint = Vec3(0.4f, static_cast<float>(height), 0.12f);
    const Precomputed box(make_builtin_scene("builtin:cornell"), options);
    Spotlight light{
        .position = Vec3(0.278f, 0.54f, 0.28f), .inner_angle = 40.0f, .outer_angle = 50.0f};
    Figures figures{{"points", static_cast<double>(box.transfer().points.size())},
                    {"R [m]", box.coarse_radius()}};
    append(figures, "view", compare(box, light, in_view(box), 0.01));
    return figures;
}

} // namespace

std::vector<Family> geometry_families() {
    const auto as_float = [](double value) { return static_cast<float>(value); };
    const std::vector<double> thickness{0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3};
    const std::vector<double> distance{0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 4.2};
    return {
        {"wall_with_door",
         "wall [% of R]",
         {0.1, 0.3, 1, 3, 10, 30, 50},
         [=](double wall) { return measure_door(as_float(wall) / 100.0f * rooms_radius, 0.9f); }},
        {"wall_closed",
         "wall [% of R]",
         {0, 0.1, 0.3, 1, 3, 10, 30, 50},
         [](double wall) { return measure_closed_wall(wall, Shell::parted); }},
        {"wall_closed_floor_through",
         "wall [% of R]",
         {0, 0.1, 0.3, 1, 3, 10, 30, 50},
         [](double wall) { return measure_closed_wall(wall, Shell::continuous); }},
        {"door",
         "door [m]",
         {0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0},
         [=](double width) { return measure_door(0.05f, as_float(width)); }},
        {"sheet", "distance [m]", distance,
         [=](double d) { return measure_sheet(1.0f, as_float(d)); }},
        {"carpet",
         "distance [m]",
         {0.001, 0.003, 0.01, 0.03, 0.1},
         [=](double d) { return measure_sheet(3.0f, as_float(d)); }},
        {"shelves", "gap [m]", {0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8}, measure_shelves},
        {"stairs", "rise [m]", {0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6}, measure_stairs},
        {"closed_corner_lit_outside", "wall [m]", thickness,
         [](double wall) { return measure_closed_corner(wall, LightAt::outside); }},
        {"closed_corner_lit_inside", "wall [m]", thickness,
         [](double wall) { return measure_closed_corner(wall, LightAt::inside); }},
        {"closed_box_lit_outside", "wall [m]", thickness,
         [](double wall) { return measure_closed_box(wall, LightAt::outside); }},
        {"closed_box_lit_inside", "wall [m]", thickness,
         [](double wall) { return measure_closed_box(wall, LightAt::inside); }},
        {"open_box", "wall [m]", thickness, measure_open_box},
        {"furnace", "rho", {0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99}, measure_furnace},
        {"clutter", "triangles", {30, 100, 300, 1000, 3000, 10000, 30000}, measure_clutter},
        {"corridor", "length / width", {1, 2, 4, 8, 16, 32}, measure_corridor},
        {"huge_and_tiny", "ground [m]", {1, 3, 10, 100, 1e3, 1e4, 1e5}, measure_grains},
        {"wires", "thickness [m]", {0.0003, 0.001, 0.003, 0.01, 0.03, 0.1}, measure_wires},
        {"viewpoint_on_floor",
         "height [m]",
         {0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1},
         measure_viewpoint},
    };
}

} // namespace afterglow
