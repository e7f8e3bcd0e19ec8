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
#include <vector>

namespace afterglow {

/// One ray of a hemispherical gather and what it adds.
struct GatherSample {
    Vec3 weight;         // omega / (pi pdf N): direction, no cosine
    std::uint32_t patch; // what the ray meets; no_index where it leaves the scene
    /// The sender level to look at, with a fraction: 0 the coarsest. Distant surfaces are seen
    /// through coarse functions, see Footprint.
    float level;
};

/// Which sender level a ray looks at: the finest whose spacing R_l is at least
/// angle * distance / max(cos, 0.3), as a mip map would be read, blended linearly in log R. The angle
/// is a constant of the operator, not of the ray count, so that receivers and their parents resolve
/// alike.
struct Footprint {
    float angle = 0.05f;
    float coarsest_spacing = 1.0f; // R_0 [world]
    int levels = 1;

    float level(const Hit& hit) const {
        const float size = angle * hit.distance / std::max(hit.cosine, 0.3f);
        return std::clamp(std::log2(coarsest_spacing / size), 0.0f, static_cast<float>(levels - 1));
    }
};

/// Directions for the rays of many receivers, density (cos + 1/2) / (2 pi): one Sobol sequence under
/// a digital shift, dealt out in the receivers' order (Morton), so that point k of receiver i is
/// number i N + k and neighbours stratify each other. Within a receiver ordered so that rays of
/// similar direction are neighbours.
class GatherDirections {
public:
    /// rays: a power of two.
    GatherDirections(int rays, std::uint64_t seed);
    int rays() const { return static_cast<int>(sobol_.size()); }
    /// directions: rays() columns about +z.
    void deal(Index receiver, Eigen::Matrix3Xf& directions) const;

private:
    std::vector<std::array<std::uint32_t, 2>> sobol_; // the first `rays` points
    std::array<std::uint32_t, 2> shift_;
};

/// Traces all gather rays of the points [begin, end): samples[(i - begin) * rays + k].
void trace_gather(const Surface& surface, const PatchGrid& grid, const PointHierarchy& points,
                  Index begin, Index end, Index first_receiver, const GatherDirections& directions,
                  const Footprint& footprint, std::vector<GatherSample>& samples);

/// A dense vector over the senders that knows which places are in use, in order.
template <class Value>
class Accumulator {
public:
    explicit Accumulator(std::size_t size, const Value& zero)
        : zero_(zero), value_(size, zero), used_((size + 63) / 64, 0) {}
    Value& at(std::uint32_t i) {
        used_[i >> 6] |= std::uint64_t{1} << (i & 63);
        return value_[i];
    }
    const Value& operator[](std::uint32_t i) const { return value_[i]; }
    /// Calls visit(i, value) for the used places in [begin, end), increasing; visit may use others
    /// outside that range.
    template <class Visit>
    void for_each(std::uint32_t begin, std::uint32_t end, const Visit& visit) {
        for (std::uint32_t word = begin >> 6; word << 6 < end; ++word) {
            std::uint64_t bits = used_[word];
            if (word << 6 < begin) bits &= ~std::uint64_t{0} << (begin & 63);
            for (; bits != 0; bits &= bits - 1) {
                const std::uint32_t i = (word << 6) + static_cast<std::uint32_t>(std::countr_zero(bits));
                if (i >= end) return;
                visit(i, value_[i]);
            }
        }
    }
    void clear() {
        for (std::size_t word = 0; word < used_.size(); ++word) {
            for (std::uint64_t bits = used_[word]; bits != 0; bits &= bits - 1)
                value_[(word << 6) + std::countr_zero(bits)] = zero_;
            used_[word] = 0;
        }
    }

private:
    Value zero_;
    std::vector<Value> value_;
    std::vector<std::uint64_t> used_;
};

} // namespace afterglow
