#pragma once

#include "basis/point_hierarchy.h"
#include "core/surface.h"
#include "transport/transfer_operator.h"

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

namespace afterglow {

class Checkpoint;

struct PrecomputeOptions {
    OperatorKind kind = OperatorKind::neumann;
    std::optional<Vec3> viewpoint; // where the scene is looked at from; found by itself otherwise
    float coarse_radius = 0.0f; // R of the coarsest level [world]; 0: from the typical ray length and how many
                                // points it takes
    /// Of the radius that is found by itself. Above 1, receivers cast coarse_scale^-1.5 times as many rays
    /// as LinkOptions says, to the nearest power of two, but at least 128: with wider functions more rays
    /// show no smaller error (docs/performance.md).
    float coarse_scale = 1.0f;
    /// Levels of receivers, spacing R, R/2, R/4 ...; the last is the display level.
    int receiver_levels = 6;
    /// Levels of senders, spaced alike; they share the points of the receivers' levels but the
    /// display level's. Finer ones send what lands on them first, and hand on, for all further
    /// bounces, what the coarser ones receive.
    int sender_levels = 5;
    LinkOptions links;
    int bounces = 0; // of indirect light; 0: all of them
    float openness_density = 0.15f; // of the display level, see DisplayLevel
    float sender_density = 0.3f;   // of the finest regular level
    std::uint64_t seed = 1;
    /// Is told from time to time which share of the work is done, roughly by time.
    std::function<void(double)> progress = {};
    /// Where to save what is done, and to go on from; not of OperatorKind::paper.
    Checkpoint* checkpoint = nullptr;

    /// For OperatorKind::paper, as printed [LZT08, secs. 2.3 and 4.2]: three levels of senders, four
    /// bounces, epsilon .025 (of links without our 1/pi). All receivers are on regular levels; of
    /// LinkOptions only rays, threshold and seed are looked at.
    static PrecomputeOptions paper();
};

/// Wall-clock seconds and counts of each stage, for --report.
struct PrecomputeReport {
    double points_seconds = 0.0, push_seconds = 0.0, pull_seconds = 0.0;
    double series_seconds = 0.0; // of the paper's bounces
    std::vector<Vec3> viewpoints;
    double mean_ray_length = 0.0;
    HierarchyStatistics hierarchy;
    std::uint64_t points_rays = 0;
    LinkStatistics links;
    double total_seconds = 0.0;
};

/// Throws UsageError for options that cannot be.
void check(const PrecomputeOptions& options);

/// From a scene to its transfer operator. Throws as check() does.
TransferOperator precompute(const Surface& surface, const PrecomputeOptions& options,
                            PrecomputeReport* report = nullptr);

} // namespace afterglow
