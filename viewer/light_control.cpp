#include "viewer/light_control.h"

#include "core/error.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace afterglow {
namespace {

void accept(Spotlight& light, Spotlight moved) {
    try {
        moved.check();
        light = moved;
    } catch (const UsageError&) { // it stays where it was
    }
}

/// The shortest text that is read back as the same number.
std::string text(float x) {
    std::array<char, 32> digits{};
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), x).ptr;
    return {digits.data(), end};
}

std::string text(const auto& v) { return text(v[0]) + "," + text(v[1]) + "," + text(v[2]); }

} // namespace

void move_along_view(Spotlight& light, const Camera& camera, float right, float upwards) {
    const float ahead = (light.position - camera.position).dot(camera.forward());
    const float height = 2.0f * camera.half_height()
                         * std::max(ahead, 0.05f * (camera.target - camera.position).norm());
    Spotlight moved = light;
    moved.position += height * (right * camera.right() + upwards * camera.top());
    accept(light, moved);
}

void aim(Spotlight& light, const Vec3& at) {
    Spotlight moved = light;
    moved.direction = at - light.position;
    accept(light, moved);
}

void widen(Spotlight& light, float factor) {
    Spotlight moved = light;
    moved.outer_angle = std::clamp(light.outer_angle * factor, 0.5f, 180.0f);
    moved.inner_angle = light.inner_angle == light.outer_angle
                            ? moved.outer_angle // stays hard, whatever is rounded
                            : std::min(light.inner_angle * moved.outer_angle / light.outer_angle, moved.outer_angle);
    accept(light, moved);
}

void put_at_camera(Spotlight& light, const Camera& camera) {
    Spotlight moved = light;
    moved.position = camera.position;
    moved.direction = camera.forward();
    accept(light, moved);
}

std::string command_line(const Camera& camera, const Spotlight& light) {
    return "--camera-position " + text(camera.position) + " --camera-target " + text(camera.target)
           + " --camera-up " + text(camera.up) + " --camera-fov " + text(camera.vertical_fov) + " --size "
           + std::to_string(camera.width) + "x" + std::to_string(camera.height) + " --light-position "
           + text(light.position) + " --light-direction " + text(light.direction) + " --light-cone "
           + text(light.inner_angle) + "," + text(light.outer_angle) + " --light-intensity "
           + text(light.intensity);
}

} // namespace afterglow
