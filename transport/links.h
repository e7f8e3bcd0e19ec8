#pragma once

#include "basis/point_hierarchy.h"
#include "basis/push.h"
#include "transport/gather.h"

#include <Eigen/Core>

#include <cstdint>
#include <string>
#include <vector>

namespace afterglow {

/// One link T_ij: the vector irradiance at receiver i that one unit of radiosity coefficient of
/// sender j makes, less what the coarser receivers predict [LZT08, eqs. (16), (17); with the 1/pi
/// that radiance B/pi brings]. No cosine, no reflectance inside; without a unit.
using LinkValue = std::array<Eigen::half, 3>;

/// All links: a row a receiver, columns are senders.
using Links = SparseRows<LinkValue>;

struct LinkOptions {
    int rays = 512; // of a receiver on the finest level; a power of two; twice as many a level up
    int most_rays = 16384;
    float footprint_angle = 0.02f; // see Footprint
    /// A link d of a receiver on level l is kept where |d| R_l^3 > threshold R_L^3 (R_L: spacing of
    /// the display level). The few coarse receivers are exact, at the price of few links: what they
    /// lose, all finer ones lose in the same direction, as bias. What is dropped of the coarsest
    /// senders goes onto those that stay, so that the response to uniform light stays exact.
    float threshold = 2e-2f;
    std::uint64_t seed = 1;
};

struct LinkStatistics {
    std::uint64_t rays = 0, links_before = 0;
    std::vector<std::uint64_t> links; // a receiver level
    double trace_seconds = 0.0, rows_seconds = 0.0, links_seconds = 0.0;
    std::uint64_t patches = 0, uncovered_patches = 0;
};

/// The rays of the receivers of one level, of so many.
GatherDirections gather_directions(const LinkOptions& options, const PointHierarchy& points,
                                   int level);

/// Gathers, differences and thresholds the links of every receiver, level by level.
Links make_links(const Surface& surface, const PointHierarchy& points, const PushOperator& push,
                 SenderRows& rows, const LinkOptions& options,
                 LinkStatistics& statistics);

} // namespace afterglow
