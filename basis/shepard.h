#pragma once

#include "core/types.h"

#include <algorithm>

namespace afterglow {

/// K(t) = 2 t^3 - 3 t^2 + 1 on [0, 1], zero beyond [LZT08, eq. (9)].
inline float kernel(float t) { return t < 1.0f ? (2.0f * t - 3.0f) * t * t + 1.0f : 0.0f; }

/// The squashed distance ||d + F (d.n) n|| with F = 2 [LZT08, eq. (10)], squared:
/// |d|^2 + ((1 + F)^2 - 1) (d.n)^2.
inline float squashed_distance2(const Vec3& d, const Vec3& n) {
    const float h = d.dot(n);
    return d.squaredNorm() + 8.0f * h * h;
}

/// The one replaceable piece of the basis: how strongly weights and point placement tell normals
/// apart, and how far supports reach.
struct BasisShape {
    /// w_j(x) = K(d_j(x) / r_j) max(0, n . n_j)^weight_power [LZT08, eq. (8): power 2].
    int weight_power = 8;
    /// D(x, y) = min(d_x(y), d_y(x)) / max(0, n_x . n_y)^placement_power [LZT08, eq. (11): power 2].
    int placement_power = 4;
    /// The same on a finest level that is placed by openness.
    int openness_placement_power = 16;
    /// Support r_j = reach * R_level, linear from the coarsest level to the finest.
    float reach_coarsest = 1.5f, reach_finest = 1.5f;

    /// As printed: cos^2 in both places, supports from 1.5 to 2.5 R.
    static BasisShape paper() {
        return {.weight_power = 2, .placement_power = 2, .reach_finest = 2.5f};
    }
};

/// max(0, c)^power for the small even powers in use.
inline float cosine_power(float c, int power) {
    float result = 1.0f;
    for (float base = std::max(0.0f, c); power > 0; power >>= 1, base *= base)
        if (power & 1) result *= base;
    return result;
}

} // namespace afterglow
