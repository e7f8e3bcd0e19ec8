#include "transport/spotlight.h"

#include "core/error.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace afterglow {

void Spotlight::check() {
    if (!is_reachable(position)) throw UsageError("a spotlight's position must be within 1e12 of the origin");
    if (!direction.allFinite() || !intensity.allFinite()
        || !std::isfinite(inner_angle) || !std::isfinite(outer_angle))
        throw UsageError("a spotlight's direction, cone and intensity must be finite");
    constexpr float narrowest = 0.05f; // cosines of less are hardly below one
    if (!(inner_angle >= 0.0f && inner_angle <= outer_angle && outer_angle >= narrowest
          && outer_angle <= 180.0f))
        throw UsageError("a spotlight's cone must satisfy 0 <= inner <= outer <= 180 and outer >= 0.05 "
                         "(half-angles in degrees), not "
                         + std::to_string(inner_angle) + "," + std::to_string(outer_angle));
    if ((intensity < 0.0f).any()) throw UsageError("a spotlight's intensity must not be negative");
    direction = direction.stableNormalized().eval();
    if (!(std::abs(direction.norm() - 1.0f) < 1e-3f))
        throw UsageError("a spotlight's direction must not be zero");
}

Spotlight Spotlight::off_surfaces(const Surface& surface) const {
    Spotlight moved = *this;
    const float lift = surface.lift();
    const Vec3 middle = surface.scene().bounds().center();
    for (int axis = 0; axis < 3; ++axis) // a plane through the light crosses one of them at 55 degrees or less
        for (const float sign : {-1.0f, 1.0f}) {
            const Vec3 along = sign * Vec3::Unit(axis);
            const Hit hit = surface.closest_hit({moved.position - 4.0f * lift * along, along, 8.0f * lift});
            if (!hit) continue;
            Vec3 normal = surface.geometric_normal(hit);
            const float towards = normal.dot(direction);
            if ((std::abs(towards) > 1e-3f ? towards : normal.dot(middle - position)) < 0.0f) normal = -normal;
            const float height = (moved.position - surface.point(hit).position).dot(normal);
            if (std::abs(height) < 2.0f * lift) moved.position += (3.0f * lift - height) * normal;
        }
    return moved;
}

float cos_degrees(float angle) {
    return static_cast<float>(std::cos(static_cast<double>(angle) * std::numbers::pi / 180.0));
}

Falloff::Falloff(const Spotlight& light)
    : cos_outer_(cos_degrees(light.outer_angle)),
      // The bound of .001 is the one of KHR_lights_punctual.
      width_(std::max(0.001f, cos_degrees(light.inner_angle) - cos_outer_)),
      hard_(light.inner_angle == light.outer_angle) {}

float Spotlight::falloff(float c) const {
    return Falloff(*this)(c);
}

Rgb unoccluded_irradiance(const Spotlight& light, const Falloff& falloff, const SurfacePoint& x) {
    const Vec3 to_light = light.position - x.position;
    const float squared_distance = to_light.squaredNorm();
    if (!(squared_distance > 0.0f)) return Rgb::Zero();
    const Vec3 direction = to_light / std::sqrt(squared_distance);
    const float cos_surface = direction.dot(x.normal);
    if (cos_surface <= 0.0f) return Rgb::Zero();
    const float share = falloff(-direction.dot(light.direction));
    return light.intensity * (share * cos_surface / squared_distance);
}

Rgb direct_irradiance(const Surface& surface, const Spotlight& light, const SurfacePoint& x) {
    const Rgb irradiance = unoccluded_irradiance(light, x);
    if ((irradiance == 0.0f).all() || surface.blocked(surface.lifted(x), light.position))
        return Rgb::Zero();
    return irradiance;
}

Rgb direct_irradiance(const Surface& surface, const Spotlight& light, const SurfacePoint& x,
                      const Vec3& shown) {
    const Rgb irradiance = unoccluded_irradiance(light, {x.position, shown});
    if ((irradiance == 0.0f).all() || (unoccluded_irradiance(light, x) == 0.0f).all()
        || surface.blocked(surface.lifted(x), light.position))
        return Rgb::Zero();
    return irradiance;
}

} // namespace afterglow
