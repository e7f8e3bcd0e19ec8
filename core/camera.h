#pragma once

#include "core/types.h"

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
    /// Unit direction through the picture at (x, y) in pixels; the centre of the first is (.5, .5).
    Vec3 direction(float x, float y) const;
};

} // namespace afterglow
