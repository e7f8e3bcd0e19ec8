#pragma once

#include "core/surface.h"
#include "core/types.h"

#include <Eigen/Core>

#include <cmath>
#include <cstdint>

namespace afterglow {

inline constexpr int openness_distances = 4;
/// Of the probes whose features are compared: all must look the same ways.
inline constexpr int openness_rays = 16;

/// What a point sees of its near surroundings, at four distances D_k = R/16, R/4, R, 4R:
///
///     F_k(x) = (1/pi) int_hemisphere omega (1 - exp(-t(omega)/D_k)) domega
///
/// with t the distance to the first surface (infinite where there is none), so that F = n on open
/// ground and shrinks or tilts beside an edge. Stored as F_k - n: three numbers a distance,
/// without a unit.
using Openness = Eigen::Matrix<float, 3 * openness_distances, 1>;

/// As it is kept, in steps of 1/64.
using OpennessCode = Eigen::Matrix<std::int8_t, 3 * openness_distances, 1>;
OpennessCode encode(const Openness& openness);
inline Openness decode(const OpennessCode& code) { return code.cast<float>() / 64.0f; }

/// Estimates the feature with `rays` short rays of length 16 R, the same directions about every
/// normal, so that equal surroundings give equal features to the last bit of noise.
class OpennessProbe {
public:
    OpennessProbe(const Surface& surface, float spacing, int rays = openness_rays);
    Openness operator()(const SurfacePoint& x) const { return completed(x, first_half(x)); }
    /// The estimate from half of the rays, for where that is enough, and what it becomes with the others.
    Openness first_half(const SurfacePoint& x) const;
    Openness completed(const SurfacePoint& x, const Openness& first_half) const;
    int rays() const { return static_cast<int>(directions_.cols()); }

private:
    const Surface& surface_;
    float spacing_;
    Eigen::Matrix3Xf directions_; // about +z

    Openness estimate(const SurfacePoint& x, Index begin, Index end) const; // with these directions
};

/// How different two points see the world: sum_k |F_k(x) - n_x - (F_k(y) - n_y)|^2.
inline float openness_difference2(const Openness& a, const Openness& b) {
    return (a - b).squaredNorm();
}

/// exp(-difference2 / s^2) with s = 0.15: how much of a value at one point is to be expected at the
/// other.
inline float openness_likeness(float difference2) {
    return std::exp(difference2 * (-1.0f / (0.15f * 0.15f)));
}

/// What a point sees of all that is farther than a few spacings, n . F for the longest distance: 1 on
/// open ground.
inline float far_openness(const Vec3& normal, const Openness& openness) {
    return 1.0f + normal.dot(openness.tail<3>());
}
/// Whether that is hardly anything, as under a carpet.
inline bool is_enclosed(const Vec3& normal, const Openness& openness) {
    return far_openness(normal, openness) < 0.1f;
}

} // namespace afterglow
