#include "core/camera.h"

#include "core/error.h"

#include <Eigen/Geometry>

#include <cmath>
#include <string>

namespace afterglow {
namespace {

constexpr int largest_side = 1 << 16; // pixels; more is a slip of the keyboard

} // namespace

void Camera::check() const {
    if (!is_reachable(position) || !is_reachable(target))
        throw UsageError("camera: position and target must be within 1e12 of the origin");
    if (!up.allFinite() || !std::isfinite(vertical_fov))
        throw UsageError("camera: up and field of view must be finite numbers");
    if (width < 1 || height < 1 || width > largest_side || height > largest_side)
        throw UsageError("camera: a picture of " + std::to_string(width) + "x"
                         + std::to_string(height) + " pixels is impossible; give 1 to "
                         + std::to_string(largest_side) + " a side");
    if (!(vertical_fov > 0.0f && vertical_fov < 180.0f))
        throw UsageError("camera: the vertical field of view must lie between 0 and 180 degrees");
    const Vec3 view = (target - position).stableNormalized();
    if (!(view.norm() > 0.5f)) throw UsageError("camera: target and position are the same place");
    if (!(view.cross(up.stableNormalized()).norm() > 1e-5f))
        throw UsageError("camera: up is zero or points along the view; choose another up");
}

float Camera::half_height() const {
    return std::tan(vertical_fov * static_cast<float>(EIGEN_PI / 360.0));
}

Vec3 Camera::direction(float x, float y) const {
    const Vec3 ahead = forward(), across = right(), upwards = across.cross(ahead);
    const float pixel = pixel_size();
    return (ahead + (x - 0.5f * static_cast<float>(width)) * pixel * across
            + (0.5f * static_cast<float>(height) - y) * pixel * upwards)
        .normalized();
}

} // namespace afterglow
