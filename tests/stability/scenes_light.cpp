#include "tests/stability/scenes_light.h"
#include "tests/support/quad.h"

#include <Eigen/Geometry>

namespace afterglow {
namespace {

using Quad = std::array<Vec3, 4>; // counter-clockwise from the air

/// The quad origin, origin + u, origin + u + v, origin + v; seen from the side of u x v.
Quad parallelogram(const Vec3& origin, const Vec3& u, const Vec3& v) {
    return {origin, origin + u, origin + u + v, origin + v};
}

/// A box seen from outside, turned about the vertical through its middle by `angle` [rad], with or
/// without its top and bottom.
void add_box(Scene& scene, const Vec3& low, const Vec3& high, float angle, bool has_top,
             bool has_bottom, std::uint32_t material) {
    const Vec3 middle = 0.5f * (low + high), half = 0.5f * (high - low);
    const Eigen::Matrix3f turn = Eigen::AngleAxisf(angle, Vec3::UnitY()).toRotationMatrix();
    const Vec3 x = turn * Vec3(half.x(), 0, 0), y(0, half.y(), 0), z = turn * Vec3(0, 0, half.z());
    if (has_top) add_quad(scene, parallelogram(middle - x + y + z, 2 * x, -2 * z), material);
    if (has_bottom) add_quad(scene, parallelogram(middle - x - y - z, 2 * x, 2 * z), material);
    add_quad(scene, parallelogram(middle - x - y + z, 2 * x, 2 * y), material);
    add_quad(scene, parallelogram(middle + x - y - z, -2 * x, 2 * y), material);
    add_quad(scene, parallelogram(middle + x - y + z, -2 * z, 2 * y), material);
    add_quad(scene, parallelogram(middle - x - y - z, 2 * z, 2 * y), material);
}

} // namespace

Scene make_room(const RoomShape& shape) {
    constexpr float length = 5.0f, height = 2.8f, width = 4.0f;
    Scene scene;
    scene.materials = {{"white", Rgb::Constant(0.7f), no_index},
                       {"red", {0.6f, 0.15f, 0.1f}, no_index},
                       {"blue", {0.15f, 0.2f, 0.6f}, no_index},
                       {"wood", {0.5f, 0.35f, 0.2f}, no_index}};
    const float o = shape.overhang;
    const Vec3 along(length + 2 * o, 0, 0), across(0, 0, width + 2 * o);
    const auto up = [&](int wall) -> Vec3 {
        return {0, (height + 2 * o) * (1.0f - shape.open[wall]), 0};
    };
    add_quad(scene, parallelogram({-o, 0, -o}, across, along), 0);
    if (shape.open[4] < 1.0f)
        add_quad(scene, parallelogram({-o, height, -o}, along * (1.0f - shape.open[4]), across), 0);
    if (shape.open[0] < 1.0f) add_quad(scene, parallelogram({0, -o, -o}, up(0), across), 1);
    if (shape.open[1] < 1.0f) add_quad(scene, parallelogram({length, -o, -o}, across, up(1)), 0);
    if (shape.open[2] < 1.0f) add_quad(scene, parallelogram({-o, -o, 0}, along, up(2)), 0);
    if (shape.open[3] < 1.0f) add_quad(scene, parallelogram({-o, -o, width}, up(3), along), 2);

    const float s = shape.sunken;
    const bool sinks = s > 0.0f;
    constexpr float low = 0.70f, high = 0.75f; // of the table's top
    add_box(scene, {0.5f, -s, 2.9f}, {1.7f, 1.3f, 3.5f}, 0.3f, true, sinks, 3);
    add_box(scene, {2.2f, low, 0.8f}, {3.8f, high, 1.8f}, 0.0f, true, true, 3);
    add_box(scene, {2.9f, -s, 1.2f}, {3.1f, sinks ? 0.5f * (low + high) : low, 1.4f}, 0.0f, sinks,
            sinks, 3);
    scene.name = "room";
    scene.summary.triangles = scene.triangles.size();
    scene.summary.faces = scene.triangles.size() / 2;
    return scene;
}

void add_board(Scene& room, const Vec3& middle, float side) {
    const Vec3 half(0.5f * side, 0.005f, 0.5f * side);
    add_box(room, middle - half, middle + half, 0.0f, true, true, 0);
}

std::vector<Spotlight> room_lights() {
    const std::array<std::array<Vec3, 2>, 8> places = {{
        {Vec3(2.3f, 2.6f, 1.9f), Vec3(0.1f, -1.0f, -0.1f)},
        {Vec3(0.8f, 2.2f, 0.8f), Vec3(0.6f, -1.0f, 0.5f)},
        {Vec3(4.2f, 2.4f, 3.2f), Vec3(-0.4f, -1.0f, -0.2f)},
        {Vec3(4.4f, 1.6f, 0.7f), Vec3(-0.5f, 0.2f, 1.0f)},
        {Vec3(1.5f, 1.8f, 1.5f), Vec3(1.0f, 0.1f, -0.3f)},
        {Vec3(2.8f, 2.0f, 3.4f), Vec3(-1.0f, -0.4f, -0.1f)},
        {Vec3(3.4f, 1.5f, 2.6f), Vec3(0.2f, 1.0f, 0.1f)},
        {Vec3(2.0f, 1.7f, 2.4f), Vec3(-0.2f, -0.3f, -1.0f)},
    }};
    std::vector<Spotlight> lights;
    for (const auto& [position, direction] : places) {
        lights.push_back({.position = position,
                          .direction = direction,
                          .inner_angle = 40.0f,
                          .outer_angle = 50.0f});
        lights.back().check();
    }
    return lights;
}

} // namespace afterglow
