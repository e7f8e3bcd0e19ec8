#pragma once

#include "core/surface.h"
#include "core/types.h"

#include <Eigen/Core>

namespace afterglow {

inline constexpr int openness_distances = 4;

/// What a point sees of its near surroundings, at four distances D_k = R/16, R/4, R, 4R:
///
///     F_k(x) = (1/pi) int_hemisphere omega (1 - exp(-t(omega)/D_k)) domega
///
/// with t the distance to the first surface (infinite where there is none), so that F = n on open
/// ground and shrinks or tilts beside an edge. Stored as F_k - n: three numbers a distance,
/// without a unit.
using Openness = Eigen::Matrix<float, 3 * openness_distances, 1>;

/// Estimates the feature with `rays` short rays of length 16 R, the same directions about every
/// normal, so that equal surroundings give equal features to the last bit of noise.
class OpennessProbe {
public:
    OpennessProbe(const Surface& surface, float spacing, int rays);
    Openness operator()(const SurfacePoint& x) const;
    int rays() const { return static_cast<int>(directions_.cols()); }

private:
    const Surface& surface_;
    float spacing_;
    Eigen::Matrix3Xf directions_; // about +z
};

/// How different two points see the world: sum_k |F_k(x) - n_x - (F_k(y) - n_y)|^2.
inline float openness_difference2(const Openness& a, const Openness& b) { return (a - b).squaredNorm(); }

} // namespace afterglow
