#pragma once

#include "core/types.h"

#include <Eigen/Geometry>

namespace afterglow {

/// A pinhole camera; pixel (0, 0) is top left, the pixel filter is a box.
struct Camera {
    Vec3 position = Vec3::Zero();
    Vec3 target = -Vec3::UnitZ();
    Vec3 up = Vec3::UnitY();
    float vertical_fov = 50.0f; // degrees, whole angle
    int width = 640, height = 360;

    /// Throws UsageError where the view is undefined (target at position, up along the view, a field
    /// of view outside (0, 180), an empty picture, anything not finite).
    void check() const;
    bool operator==(const Camera&) const = default;

    /// Where it looks, unit length; to its right; upwards in the picture. A frame where check() passes.
    Vec3 forward() const { return (target - position).stableNormalized(); }
    Vec3 right() const { return forward().cross(up.stableNormalized()).normalized(); }
    Vec3 top() const { return right().cross(forward()); }
    /// Half of what the picture's height is at distance one.
    float half_height() const;
    /// What a pixel's side is there.
    float pixel_size() const { return 2.0f * half_height() / static_cast<float>(height); }
    /// Unit direction through the picture at (x, y) in pixels; the centre of the first is (.5, .5).
    Vec3 direction(float x, float y) const;
};

} // namespace afterglow
