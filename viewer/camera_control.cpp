#include "viewer/camera_control.h"

#include "core/error.h"

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

constexpr float closest_to_up = 2.0f * static_cast<float>(EIGEN_PI) / 180.0f;

void accept(Camera& camera, const Camera& moved) {
    try {
        moved.check();
        camera = moved;
    } catch (const UsageError&) { // it stays where it was
    }
}

/// The turn by which a view goes to the right and upwards, as far as `up` lets it.
Eigen::Matrix3f turn(const Camera& camera, float right, float upwards) {
    const Vec3 up = camera.up.normalized();
    const float from_up = std::acos(std::clamp(camera.forward().dot(up), -1.0f, 1.0f));
    const float lifted = std::clamp(from_up - upwards, closest_to_up,
                                    static_cast<float>(EIGEN_PI) - closest_to_up);
    return (Eigen::AngleAxisf(-right, up) * Eigen::AngleAxisf(from_up - lifted, camera.right()))
        .toRotationMatrix();
}

} // namespace

void orbit(Camera& camera, const Vec3& pivot, float right, float upwards) {
    // The camera goes the other way than what is seen.
    const Eigen::Matrix3f m = turn(camera, right, upwards);
    Camera moved = camera;
    moved.position = pivot + m * (camera.position - pivot);
    moved.target = moved.position + m * (camera.target - camera.position);
    accept(camera, moved);
}

void look(Camera& camera, float right, float upwards) {
    Camera moved = camera;
    moved.target = camera.position + turn(camera, right, upwards) * (camera.target - camera.position);
    accept(camera, moved);
}

void pan(Camera& camera, float right, float upwards) {
    const float height = 2.0f * camera.half_height() * (camera.target - camera.position).norm();
    const Vec3 shift = -height * (right * camera.right() + upwards * camera.top());
    Camera moved = camera;
    moved.position += shift;
    moved.target += shift;
    accept(camera, moved);
}

void zoom(Camera& camera, const Vec3& towards, float factor) {
    Camera moved = camera;
    moved.position = towards + factor * (camera.position - towards);
    // The view keeps its direction; the target's distance shrinks alike.
    moved.target = moved.position + factor * (camera.target - camera.position);
    accept(camera, moved);
}

void fly(Camera& camera, float right, float upwards, float ahead) {
    const Vec3 shift = right * camera.right() + upwards * camera.up.normalized()
                       + ahead * camera.forward();
    Camera moved = camera;
    moved.position += shift;
    moved.target += shift;
    accept(camera, moved);
}

} // namespace afterglow
