#pragma once

#include "basis/point_hierarchy.h"
#include "core/surface.h"
#include "transport/sender_rows.h"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// One ray of a hemispherical gather and what it adds: `weight` times the field of the senders where
/// it ends, as one sender level has it.
struct GatherSample {
    Vec3 weight;       // omega / (pi pdf N): direction, no cosine
    std::uint32_t row; // number of SenderRows, then its place; no_index where the ray leaves the scene
};

/// Which sender level a ray looks at: the finest whose spacing R_l is at least
/// angle * distance / max(cos, 0.3), as a mip map would be read; between two levels a ray takes one,
/// with probabilities linear in log R. The angle is a constant of the operator, not of the ray count,
/// so that receivers and their parents resolve alike.
struct Footprint {
    float angle = 0.02f;
    float coarsest_spacing = 1.0f; // R_0 [world]
    int levels = 1;

    float level(const Hit& hit) const {
        const float size = std::max(angle * hit.distance / std::max(hit.cosine, 0.3f), 1e-30f);
        return std::clamp(std::log2(coarsest_spacing / size), 0.0f, static_cast<float>(levels - 1));
    }
};

/// Directions for the rays of many receivers, density (cos + 1/2) / (2 pi): one Sobol sequence under
/// a digital shift, dealt out in the receivers' order (Morton), so that point k of receiver i is
/// number i N + k and neighbours stratify each other. Within a receiver they come in Morton order of the
/// square that they are made from, so that rays of similar direction are neighbours.
class GatherDirections {
public:
    /// rays: a power of two.
    GatherDirections(int rays, std::uint64_t seed);
    int rays() const { return static_cast<int>(sobol_.size()); }
    /// directions: rays() columns about +z.
    void deal(Index receiver, Eigen::Matrix3Xf& directions) const;

private:
    std::vector<std::array<std::uint32_t, 2>> sobol_; // the first `rays` points, in Morton order
    std::array<std::uint32_t, 2> shift_;
};

/// Where light arrives from: the ends of 8 rays of every receiver, in the receivers' order, for
/// SenderRows::see.
std::vector<Hit> arrivals(const Surface& surface, const PointHierarchy& points, std::uint64_t seed);

/// Traces the gather rays of as many receivers as `samples` has room for, from `begin` on, points of a level
/// that begins with level_begin: samples[(i - begin) directions.rays() + k].
void trace_gather(const Surface& surface, const SenderRows& rows, const PointHierarchy& points, Index begin,
                  Index level_begin, const GatherDirections& directions, const Footprint& footprint,
                  std::span<GatherSample> samples);

} // namespace afterglow
