#include "tests/stability/scenes.h"

#include "core/sampling.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>

namespace afterglow {
namespace {

constexpr float seal = 0.05f; // how far walls reach into the shell of their room [m]
const Vec3 room_size(5.0f, 2.8f, 4.0f);
const Vec3 cube_size(5.0f, 5.0f, 5.0f);

/// The face of a box at the upper or lower end of an axis, seen from outside.
Quad face(const Vec3& min, const Vec3& max, int axis, bool upper) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Vec3 corner = min;
    if (upper) corner[axis] = max[axis];
    const Vec3 along_u = (max[u] - min[u]) * Vec3::Unit(u);
    const Vec3 along_v = (max[v] - min[v]) * Vec3::Unit(v);
    const Quad quad{corner, along_u, along_v};
    return upper ? quad : quad.flipped();
}

/// A hard cone, 45 degrees if nothing else is said, towards a point.
Spotlight light_towards(const Vec3& position, const Vec3& target, float angle = 45.0f) {
    Spotlight light{.position = position,
                    .direction = target - position,
                    .inner_angle = angle,
                    .outer_angle = angle};
    light.check();
    return light;
}

Spotlight room_lamp() {
    return light_towards({3.6f, 2.5f, 2.6f}, {2.6f, 0.0f, 1.8f});
}

// Of the rack and the stairs.
const Vec3 rack_corner(2.0f, 0.1f, 0.0f);
constexpr float rack_width = 1.0f, rack_depth = 0.4f, rack_top = 2.0f, board = 0.02f;
const Vec3 stairs_corner(1.8f, 0.0f, 1.2f);
constexpr float stairs_height = 1.2f, stairs_width = 1.5f;

int boards(float gap) {
    return 1 + static_cast<int>((rack_top - rack_corner.y() - board) / (gap + board));
}

int steps(float rise) {
    return std::max(1, static_cast<int>(std::lround(stairs_height / rise)));
}

} // namespace

std::vector<SurfacePoint> places_on(const Quad& quad, int count, std::uint64_t seed) {
    const float ratio = quad.u.norm() / quad.v.norm();
    const int columns = std::clamp(
        static_cast<int>(std::lround(std::sqrt(static_cast<float>(count) * ratio))), 1, count);
    const int rows = std::max(1, count / columns);
    std::vector<SurfacePoint> places;
    for (int i = 0; i < columns * rows; ++i) {
        Rng rng(seed, static_cast<std::uint64_t>(i));
        const float s =
            (static_cast<float>(i % columns) + rng.uniform()) / static_cast<float>(columns);
        const float t =
            (static_cast<float>(i / columns) + rng.uniform()) / static_cast<float>(rows);
        places.push_back({quad.corner + s * quad.u + t * quad.v, quad.normal()});
    }
    return places;
}

SceneBuilder::SceneBuilder(float reflectance) {
    scene_.materials.push_back({"all", Rgb::Constant(reflectance), no_index});
}

void SceneBuilder::add_triangle(const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto first = static_cast<std::uint32_t>(scene_.positions.size());
    scene_.positions.insert(scene_.positions.end(), {a, b, c});
    scene_.triangles.push_back({first, first + 1, first + 2});
    scene_.material_index.push_back(0);
}

void SceneBuilder::add(const Quad& quad) {
    const auto first = static_cast<std::uint32_t>(scene_.positions.size());
    scene_.positions.insert(
        scene_.positions.end(),
        {quad.corner, quad.corner + quad.u, quad.corner + quad.u + quad.v, quad.corner + quad.v});
    scene_.triangles.push_back({first, first + 1, first + 2});
    scene_.triangles.push_back({first, first + 2, first + 3});
    scene_.material_index.insert(scene_.material_index.end(), 2, 0);
}

void SceneBuilder::add_box(const Vec3& min, const Vec3& max) {
    for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
            add(face(min, max, axis, upper));
}

void SceneBuilder::add_room(const Vec3& min, const Vec3& max) {
    for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
            add(face(min, max, axis, upper).flipped());
}

void SceneBuilder::add_wall(const Vec3& min, const Vec3& max) {
    for (int axis = 0; axis < 3; ++axis)
        if (min[axis] == max[axis]) return add(face(min, max, axis, true));
    add_box(min, max);
}

Scene SceneBuilder::finish(const Vec3& viewpoint) {
    scene_.viewpoint = viewpoint;
    scene_.summary.triangles = scene_.triangles.size();
    return std::move(scene_);
}

LitScene two_rooms(float wall, float door_width, Shell shell) {
    constexpr float height = 2.8f, depth = 4.0f, length = 4.0f, door_height = 2.0f;
    const float left = 0.5f * (depth - door_width), right = 0.5f * (depth + door_width);
    const float end = length + wall;
    SceneBuilder builder;
    if (shell == Shell::continuous) {
        builder.add_room({0, 0, 0}, {end + length, height, depth});
    } else {
        for (int axis = 0; axis < 3; ++axis)
            for (const bool upper : {false, true}) {
                const bool is_end = axis == 0;
                if (!(is_end && upper))
                    builder.add(face({0, 0, 0}, {length, height, depth}, axis, upper).flipped());
                if (!(is_end && !upper))
                    builder.add(
                        face({end, 0, 0}, {end + length, height, depth}, axis, upper).flipped());
            }
        if (door_width > 0.0f && wall > 0.0f) // the threshold
            builder.add({{length, 0, left}, {0, 0, door_width}, {wall, 0, 0}});
    }
    if (door_width > 0.0f) {
        builder.add_wall({length, -seal, -seal}, {end, height + seal, left});
        builder.add_wall({length, -seal, right}, {end, height + seal, depth + seal});
        builder.add_wall({length, door_height, left}, {end, height + seal, right});
    } else {
        builder.add_wall({length, -seal, -seal}, {end, height + seal, depth + seal});
    }
    return {builder.finish({2.0f, 1.4f, 2.0f}),
            light_towards({2.0f, 2.6f, 2.0f}, {2.0f, 0.0f, 2.0f}, 50.0f)};
}

LitScene sheet_above_floor(float side, float distance) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), cube_size);
    const float begin = 0.5f * (cube_size.x() - side);
    builder.add({{begin, distance, begin}, {0, 0, side}, {side, 0, 0}});
    return {builder.finish({1.0f, 2.5f, 1.0f}),
            light_towards({1.0f, 4.8f, 1.4f}, {2.5f, 0.0f, 2.5f}, 40.0f)};
}

std::vector<Quad> covered_by_sheet(float side, float distance) {
    const float begin = 0.5f * (cube_size.x() - side);
    return {{{begin, 0, begin}, {0, 0, side}, {side, 0, 0}},
            {{begin, distance, begin}, {side, 0, 0}, {0, 0, side}}};
}

LitScene shelves(float gap) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), room_size);
    for (int i = 0; i < boards(gap); ++i) {
        const Vec3 corner = rack_corner + static_cast<float>(i) * (gap + board) * Vec3::UnitY()
                            - seal * Vec3::UnitZ();
        builder.add_box(corner, corner + Vec3(rack_width, board, rack_depth + seal));
    }
    return {builder.finish({2.5f, 1.4f, 2.5f}), room_lamp()};
}

std::vector<Quad> shelf_gaps(float gap) {
    std::vector<Quad> sides;
    for (int i = 0; i + 1 < boards(gap); ++i) {
        const Vec3 lower =
            rack_corner + (static_cast<float>(i) * (gap + board) + board) * Vec3::UnitY();
        const Vec3 across = rack_width * Vec3::UnitX(), inwards = rack_depth * Vec3::UnitZ();
        sides.push_back({lower, inwards, across});
        sides.push_back({lower + gap * Vec3::UnitY(), across, inwards});
    }
    return sides;
}

LitScene stairs(float rise) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), room_size);
    for (const Quad& quad : stair_steps(rise))
        builder.add(quad);
    const float step = stairs_height / static_cast<float>(steps(rise));
    const Vec3 across = stairs_width * Vec3::UnitZ(), along = step * Vec3::UnitX();
    for (int i = 0; i < steps(rise); ++i) { // the flanks
        const Vec3 corner = stairs_corner + static_cast<float>(i) * along;
        const Vec3 up = static_cast<float>(i + 1) * step * Vec3::UnitY();
        builder.add({corner, up, along});
        builder.add({corner + across, along, up});
    }
    const Vec3 back = stairs_corner + stairs_height * Vec3::UnitX();
    builder.add({back, stairs_height * Vec3::UnitY(), across});
    return {builder.finish({0.8f, 1.4f, 2.0f}),
            light_towards({0.8f, 2.5f, 2.6f}, {2.2f, 0.4f, 1.9f})};
}

std::vector<Quad> stair_steps(float rise) {
    const float step = stairs_height / static_cast<float>(steps(rise));
    const Vec3 across = stairs_width * Vec3::UnitZ();
    const Vec3 along = step * Vec3::UnitX(), up = step * Vec3::UnitY();
    std::vector<Quad> quads;
    for (int i = 0; i < steps(rise); ++i) {
        const Vec3 foot = stairs_corner + static_cast<float>(i) * (along + up);
        quads.push_back({foot, across, up});
        quads.push_back({foot + up, across, along});
    }
    return quads;
}

LitScene closed_corner(float wall, LightAt light) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), room_size);
    const float top = room_size.y() + seal;
    builder.add_wall({1.0f, -seal, -seal}, {1.0f + wall, top, 1.0f + wall});
    builder.add_wall({-seal, -seal, 1.0f}, {1.0f, top, 1.0f + wall});
    if (light == LightAt::inside)
        return {builder.finish({2.5f, 1.4f, 2.0f}),
                light_towards({0.5f, 2.6f, 0.5f}, {0.55f, 0.0f, 0.5f})};
    return {builder.finish({2.5f, 1.4f, 2.0f}), room_lamp()};
}

LitScene box_in_room(float wall, bool lid, LightAt light) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), cube_size);
    const Vec3 inner = Vec3::Constant(2.0f), outer = inner - Vec3::Constant(wall);
    const Vec3 inner_end = Vec3::Constant(3.0f), outer_end = inner_end + Vec3::Constant(wall);
    const float top = lid ? inner_end.y() : outer_end.y();
    builder.add_wall(outer, {outer_end.x(), inner.y(), outer_end.z()}); // bottom
    if (lid) builder.add_wall({outer.x(), inner_end.y(), outer.z()}, outer_end);
    builder.add_wall({outer.x(), inner.y(), outer.z()}, {inner.x(), top, outer_end.z()});
    builder.add_wall({inner_end.x(), inner.y(), outer.z()}, {outer_end.x(), top, outer_end.z()});
    builder.add_wall({inner.x(), inner.y(), outer.z()}, {inner_end.x(), top, inner.z()});
    builder.add_wall({inner.x(), inner.y(), inner_end.z()}, {inner_end.x(), top, outer_end.z()});
    if (light == LightAt::inside)
        return {builder.finish({1.0f, 2.5f, 1.0f}),
                light_towards({2.5f, 2.9f, 2.5f}, {2.6f, 2.0f, 2.5f})};
    return {builder.finish({1.0f, 2.5f, 1.0f}),
            light_towards({1.6f, 4.8f, 1.8f}, {2.5f, 2.5f, 2.5f})};
}

std::vector<Quad> inside_of_box() {
    std::vector<Quad> sides;
    for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
            if (!(axis == 1 && upper))
                sides.push_back(
                    face(Vec3::Constant(2.0f), Vec3::Constant(3.0f), axis, upper).flipped());
    return sides;
}

LitScene clutter(int count, float area, std::uint64_t seed) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), room_size);
    // An equilateral triangle of circumradius r has the area 3 sqrt(3) / 4 r^2.
    const float r = std::sqrt(area / static_cast<float>(count) * 4.0f / (3.0f * std::sqrt(3.0f)));
    for (int i = 0; i < count; ++i) {
        Rng rng(seed, static_cast<std::uint64_t>(i));
        const Vec3 low(1.5f, 0.3f, 1.0f), size(2.0f, 1.6f, 2.0f);
        const Vec3 centre =
            low + size.cwiseProduct(Vec3(rng.uniform(), rng.uniform(), rng.uniform()));
        const Frame frame(sample_sphere({rng.uniform(), rng.uniform()}));
        const float turn = 2.0f * static_cast<float>(EIGEN_PI) * rng.uniform();
        std::array<Vec3, 3> corner;
        for (int k = 0; k < 3; ++k) {
            const float angle =
                turn + 2.0f * static_cast<float>(EIGEN_PI) / 3.0f * static_cast<float>(k);
            corner[k] = centre + r * (std::cos(angle) * frame.x + std::sin(angle) * frame.y);
        }
        builder.add_triangle(corner[0], corner[1], corner[2]);
    }
    return {builder.finish({0.7f, 1.4f, 2.0f}),
            light_towards({0.8f, 2.5f, 2.6f}, {2.5f, 0.6f, 2.0f})};
}

LitScene corridor(float length) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), {length, 2.0f, 2.0f});
    return {builder.finish({0.5f * length, 1.0f, 1.0f}),
            light_towards({0.9f, 1.6f, 1.0f}, {0.1f, 0.6f, 1.0f})};
}

std::vector<Quad> corridor_section(float length, float from, float to) {
    std::vector<Quad> walls;
    for (const int axis : {1, 2})
        for (const bool upper : {false, true}) {
            Quad wall = face(Vec3::Zero(), {length, 2.0f, 2.0f}, axis, upper).flipped();
            wall.corner.x() = from;
            for (Vec3* edge : {&wall.u, &wall.v})
                if (edge->x() > 0.0f) edge->x() = to - from;
            walls.push_back(wall);
        }
    return walls;
}

LitScene grains_on_ground(float ground) {
    SceneBuilder builder;
    // Its inscribed circle has the radius `ground`.
    const float half = std::sqrt(3.0f) * ground;
    builder.add_triangle({0.5f - half, -0.01f, 0.5f + ground}, {0.5f + half, -0.01f, 0.5f + ground},
                         {0.5f, -0.01f, 0.5f - 2.0f * ground});
    for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
            if (!(axis == 2 && upper))
                builder.add(face(Vec3::Zero(), Vec3::Ones(), axis, upper).flipped());
    for (int i = 0; i < 2000; ++i) {
        Rng rng(3, static_cast<std::uint64_t>(i));
        const Vec3 centre(rng.uniform(), 0.03f * rng.uniform(), rng.uniform());
        std::array<Vec3, 3> corner;
        for (Vec3& c : corner)
            c = centre + 0.012f * sample_sphere({rng.uniform(), rng.uniform()});
        builder.add_triangle(corner[0], corner[1], corner[2]);
    }
    return {builder.finish({0.5f, 0.6f, 0.7f}),
            light_towards({0.5f, 0.9f, 0.8f}, {0.5f, 0.0f, 0.4f}, 35.0f)};
}

LitScene wires(float thickness) {
    SceneBuilder builder;
    builder.add_room(Vec3::Zero(), room_size);
    for (int i = 0; i < 60; ++i) {
        Rng rng(11, static_cast<std::uint64_t>(i));
        const int along = i % 2 == 0 ? 0 : 2, across = 2 - along;
        Vec3 min = Vec3::Constant(-seal), max;
        min.y() = 0.4f + 2.0f * rng.uniform();
        min[across] = room_size[across] * (0.1f + 0.8f * rng.uniform());
        max = min + Vec3::Constant(thickness);
        max[along] = room_size[along] + seal;
        builder.add_box(min, max);
    }
    return {builder.finish({2.5f, 1.4f, 2.0f}), room_lamp()};
}

} // namespace afterglow
