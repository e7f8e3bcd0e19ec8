#pragma once

#include "core/surface.h"
#include "core/types.h"

#include <algorithm>

namespace afterglow {

/// The spotlight of glTF KHR_lights_punctual, read radiometrically: a point that sends
/// intensity * falloff(angle) [W/sr].
struct Spotlight {
    Vec3 position = Vec3::Zero();
    Vec3 direction = -Vec3::UnitY(); // unit length
    float inner_angle = 0.0f;        // half-angle of full intensity [degrees]
    float outer_angle = 45.0f;       // half-angle where it ends [degrees]; equal to inner: hard
    Rgb intensity = Rgb::Ones();     // W/sr on the axis

    /// Normalises the direction. Throws UsageError unless 0 <= inner <= outer <= 180, outer >= 0.05,
    /// the direction is not zero and everything is finite (intensity also not negative).
    void check();
    /// Whether another differs in intensity at most.
    bool shines_alike(const Spotlight& other) const {
        return position == other.position && direction == other.direction
               && inner_angle == other.inner_angle && outer_angle == other.outer_angle;
    }
    /// The same light, moved off the surfaces that it lies on within a few roundings (Surface::lift()), to the side
    /// that it shines to (along a wall: to the scene's middle): as a lamp in the plane of its ceiling, of which rounding
    /// would hide some.
    Spotlight off_surfaces(const Surface& surface) const;
    /// Share of the intensity sent at the cosine c of the angle from the axis, in [0, 1].
    float falloff(float c) const;
};

/// Cosine of an angle [degrees]. Whoever asks what a cone contains rounds it alike, which matters for narrow ones.
float cos_degrees(float angle);

/// Spotlight::falloff of one light, with its cosines at hand: for many c.
class Falloff {
public:
    explicit Falloff(const Spotlight& light);
    float operator()(float c) const {
        if (hard_) return c >= cos_outer_ ? 1.0f : 0.0f;
        if (c <= cos_outer_) return 0.0f;
        const float t = std::min(1.0f, (c - cos_outer_) / width_);
        return t * t;
    }

private:
    float cos_outer_, width_;
    bool hard_;
};

/// E(x) = I falloff cos(theta) / r^2 without visibility [W/m^2], zero where the surface faces away.
Rgb unoccluded_irradiance(const Spotlight& light, const Falloff& falloff, const SurfacePoint& x);
inline Rgb unoccluded_irradiance(const Spotlight& light, const SurfacePoint& x) {
    return unoccluded_irradiance(light, Falloff(light), x);
}

/// The same times visibility: one shadow ray where it is not zero already. Reflectance not
/// included.
Rgb direct_irradiance(const Surface& surface, const Spotlight& light, const SurfacePoint& x);

/// The same with the normal that a picture shows there (Surface::shown_normal): the cosine is that of
/// `shown`, and light from below the surface, as x.normal has it, is none.
Rgb direct_irradiance(const Surface& surface, const Spotlight& light, const SurfacePoint& x,
                      const Vec3& shown);

} // namespace afterglow
