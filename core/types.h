#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>

namespace afterglow {

using Vec2 = Eigen::Vector2f;
using Vec3 = Eigen::Vector3f; // world space, the scene's own unit, unless a comment says otherwise
using Rgb = Eigen::Array3f;   // linear light, Rec. 709 primaries
using Index = std::int64_t;

/// A place on a surface together with the side it is seen from.
struct SurfacePoint {
    Vec3 position = Vec3::Zero();
    Vec3 normal = Vec3::UnitY(); // unit length, points to the side the surface is looked at
};

} // namespace afterglow
