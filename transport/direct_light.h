#pragma once

#include "basis/shepard_basis.h"
#include "core/surface.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// Direct light as the finest level of senders takes it. Two estimates share the light, by the
/// distance d of the lit place from it:
///
///     E(y) = p(d) E(y) + (1 - p(d)) E(y),   p = smoothstep((s(d) / R - 4) / (10 - 4)),
///
/// where s(d) = d min(1, tan(outer angle)) is the scale on which E changes there (half the width of
/// what is lit, at most the distance) and R the spacing of the senders.
///
/// Where it is many spacings, the first share is *sampled* at the points: rho_j p E(x_j), a shadow ray
/// each. Where it is few, points could miss what is lit, or its brightest part; the second share is
/// *splatted*: rays leave the light, number k carries the flux Phi_k, and
///
///     b_j += sum_k rho(y_k) (1 - p) Phi_k B_j(y_k) / <B_j, 1>,
///
/// which loses no light however small the lit place is. Rays end where p = 1, so that they cost
/// nothing where the light is far from everything.
class DirectLight {
public:
    /// The senders of one level; `areas`: <B_j, 1> of each [world^2], 0 where none was seen. Keeps
    /// references.
    DirectLight(const PointHierarchy& points, int level, std::span<const float> areas,
                const Surface& surface);

    /// Radiosity of the level's points by direct light, three numbers (R, G, B) each [W/m^2].
    void radiosity(const Spotlight& light, std::span<float> result) const;

private:
    const PointHierarchy& points_;
    int level_;
    std::span<const float> areas_;
    const Surface& surface_;
    ShepardBasis basis_;

    void sample(const Spotlight& light, std::span<float> result) const;
    void splat(const Spotlight& light, std::span<float> result) const;
};

/// p(d), see DirectLight.
float sampled_share(const Spotlight& light, float distance, float spacing);

} // namespace afterglow
