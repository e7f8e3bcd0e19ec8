#include "core/normal_map.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

constexpr float lowest = 0.01f; // sine of a mapped normal's height above the surface

/// The coordinates of colours, 0 to 1; a channel of 128 is zero, so that flat ground is flat.
Vec3 direction_of(const float* rgb) {
    const auto coordinate = [](float c) { return std::clamp((255.0f * c - 128.0f) / 127.0f, -1.0f, 1.0f); };
    return {coordinate(rgb[0]), coordinate(rgb[1]), coordinate(rgb[2])};
}

} // namespace

bool is_normal_map(const Texture& picture) {
    std::size_t like = 0;
    for (std::size_t i = 0; i < picture.rgb.size(); i += 3) {
        const float* c = &picture.rgb[i];
        const Vec3 n = direction_of(c);
        like += (c[0] != c[1] || c[1] != c[2]) && n.z() > 0.0f && std::abs(n.norm() - 1.0f) < 0.15f;
    }
    return 10 * like >= 9 * (picture.rgb.size() / 3);
}

Texture normals_from_colours(Texture picture) {
    for (std::size_t i = 0; i < picture.rgb.size(); i += 3) {
        const Vec3 n = direction_of(&picture.rgb[i]);
        const float length = n.norm();
        Vec3::Map(&picture.rgb[i]) = length > 0.1f ? Vec3(n / length) : Vec3(Vec3::UnitZ());
    }
    return picture;
}

Texture normals_from_heights(const Texture& picture, float multiplier) {
    const int width = picture.width, height = picture.height;
    const auto at = [&](int x, int y) {
        const std::size_t texel = static_cast<std::size_t>((y + height) % height) * static_cast<std::size_t>(width)
                                  + static_cast<std::size_t>((x + width) % width);
        const float* c = &picture.rgb[3 * texel];
        return multiplier * (c[0] + c[1] + c[2]) / 3.0f;
    };
    Texture normals{width, height, {}};
    normals.rgb.resize(picture.rgb.size());
    float* to = normals.rgb.data();
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x, to += 3) {
            const float along_u = 0.5f * (at(x + 1, y) - at(x - 1, y));
            const float along_v = 0.5f * (at(x, y + 1) - at(x, y - 1));
            Vec3::Map(to) = Vec3(-along_u, -along_v, 1.0f).normalized();
        }
    return normals;
}

Tangent tangent_of(const Scene& scene, std::uint32_t triangle) {
    if (scene.texture_indices.empty() || scene.texture_indices[triangle][0] == no_index) return {};
    const Triangle& corners = scene.triangles[triangle];
    const Triangle& uv = scene.texture_indices[triangle];
    const auto edge = [&](int k) -> Eigen::Vector3d {
        return (scene.positions[corners[k]] - scene.positions[corners[0]]).cast<double>();
    };
    const auto uv_edge = [&](int k) -> Eigen::Vector2d {
        return (scene.texture_coordinates[uv[k]] - scene.texture_coordinates[uv[0]]).cast<double>();
    };
    // Position is affine in (u, v): edge(k) = u_k T + v_k B.
    const Eigen::Vector2d first = uv_edge(1), second = uv_edge(2);
    const double area = first.x() * second.y() - second.x() * first.y();
    if (!(std::abs(area) > 1e-9 * std::max(first.squaredNorm(), second.squaredNorm()))) return {};
    const double sign = area > 0.0 ? 1.0 : -1.0;
    const Eigen::Vector3d along_u = sign * (second.y() * edge(1) - first.y() * edge(2));
    const Eigen::Vector3d unit = along_u.stableNormalized();
    if (!(std::abs(unit.norm() - 1.0) < 1e-3)) return {};
    return {unit.cast<float>(), static_cast<float>(sign)};
}

Vec3 mapped_normal(const Vec3& mapped, const Tangent& tangent, const Vec3& normal,
                   const Vec3& geometric, bool back_side) {
    const float side = back_side ? -1.0f : 1.0f;
    const Vec3 front = side * normal;
    const Vec3 along = tangent.direction - front.dot(tangent.direction) * front;
    const float length = along.norm();
    if (length < 1e-3f) return normal;
    const Vec3 x = along / length, y = tangent.sign * front.cross(x);
    const Vec3 turned = side * (mapped.x() * x + mapped.y() * y + mapped.z() * front);
    const float size = turned.norm();
    if (size < 1e-3f) return normal;
    const Vec3 n = turned / size;
    const float height = n.dot(geometric);
    return height >= lowest ? n : Vec3((n + (lowest - height) * geometric).normalized());
}

} // namespace afterglow
