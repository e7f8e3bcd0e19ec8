#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>

namespace afterglow {

using Vec2 = Eigen::Vector2f;
using Vec3 = Eigen::Vector3f; // world space, the scene's own unit, unless a comment says otherwise
using Rgb = Eigen::Array3f;   // linear light, Rec. 709 primaries
using Index = std::int64_t;

/// Of positions and lengths. Embree multiplies three of them, and ends the process where that is not finite.
inline constexpr float largest_coordinate = 1e12f;
/// Whether all are numbers within it.
inline bool is_reachable(const Eigen::Ref<const Eigen::ArrayXf>& position) {
    return (position.abs() <= largest_coordinate).all();
}

/// A place on a surface together with the side it is seen from.
struct SurfacePoint {
    Vec3 position = Vec3::Zero();
    Vec3 normal = Vec3::UnitY(); // unit length, points to the side the surface is looked at
};

} // namespace afterglow
