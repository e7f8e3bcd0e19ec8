#pragma once

#include "basis/nearest_points.h"
#include "basis/shepard_basis.h"
#include "core/surface.h"
#include "transport/spotlight.h"

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
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
/// each. Where the light that is seen, falloff V, differs from a neighbour's by more than a quarter,
/// an edge of a shadow or of the cone is close, and E is the mean over 8 places within a quarter of
/// the spacing: so that an edge that moves switches no sender at once. Where s is few spacings, points could
/// miss what is lit, or its brightest part; the second share is *splatted*: rays leave the light, number k
/// carries the flux Phi_k, times the cosine on the shading normal ÷ that on the triangle, and
///
///     b_j += sum_k rho(y_k) (1 - p) Phi_k B_j(y_k) / <B_j, 1>,
///
/// which loses no light however small the lit place is. Light on functions that are seen nowhere is dropped;
/// that on functions on edges, SenderRows::in_few_rows, goes to the four closest others in sight, by area. Rays
/// end where p = 1, so that they cost nothing where the light is far from everything. Of the 8192, so many of
/// their sequence's first ones count where they end, each with as much more flux, that 64 (1 - p)^2 fall on a
/// sender.
class DirectLight {
public:
    /// The senders of one level; `areas`: SenderRows::finest_areas(). Keeps references.
    DirectLight(const PointHierarchy& points, int level, std::span<const float> areas,
                const Surface& surface);

    /// Radiosity of the level's points by direct light, three numbers (R, G, B) each [W/m^2].
    void radiosity(const Spotlight& light, std::span<float> result) const;

private:
    const PointHierarchy& points_;
    int level_;
    std::span<const float> areas_;
    const Surface& surface_;
    // What few lights ask of few points is made when it is first asked for.
    mutable std::once_flag nearest_made_, basis_made_;
    mutable std::unique_ptr<const NearestPoints> nearest_;
    mutable std::unique_ptr<const ShepardBasis> basis_;
    using Neighbours = std::array<std::uint32_t, 12>; // counted from the level's first; itself if fewer
    mutable std::vector<Neighbours> neighbours_;      // closest points that face the same side
    enum Known : std::uint8_t { unknown, at_work, known };
    mutable std::vector<std::atomic<std::uint8_t>> neighbours_known_;
    /// A bit for each of the places around a point: whether it is behind something.
    mutable std::vector<std::atomic<std::uint16_t>> apart_;
    static constexpr std::uint16_t apart_unknown = 1 << 15;

    /// A sender's share of E(x) that is seen, and what it is of.
    struct Lit {
        float sampled = 0.0f; // p
        float seen = unasked; // falloff V
    };
    static constexpr float unasked = -1.0f; // where the light is behind, or only splatted

    const NearestPoints& nearest() const;
    const ShepardBasis& basis() const;
    void find_neighbours(std::size_t k, Neighbours& found) const;
    const Neighbours& neighbours(std::size_t k, Neighbours& scratch) const;
    void sample_points(const Spotlight& light, std::span<Lit> lit, std::span<float> result) const;
    bool on_edge(std::span<const Lit> lit, std::size_t k) const;
    /// Mean of E around a point [W/m^2].
    Rgb mean_irradiance(const Spotlight& light, const Falloff& falloff, Index k) const;
    void sample(const Spotlight& light, std::span<float> result) const;
    void splat(const Spotlight& light, std::span<float> result) const;
    /// Leaves in a row at y the functions that have an area, and gives others what those on edges had.
    void keep_seen(const SurfacePoint& y, std::vector<BasisEntry>& row) const;
};

/// p(d), see DirectLight.
float sampled_share(const Spotlight& light, float distance, float spacing);

} // namespace afterglow
