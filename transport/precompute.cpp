#include "transport/precompute.h"

#include "core/error.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The coarsest spacing as a share of the typical ray length: a few functions a room. With the
/// default levels the finest senders are 1/25 of that length apart.
constexpr float coarsest_share = 1.28f;

} // namespace

void check(const PrecomputeOptions& options) {
    if (options.receiver_levels < 2 || options.receiver_levels > 10)
        throw UsageError("--receiver-levels must lie between 2 and 10");
    if (options.sender_levels < 1 || options.sender_levels > 10)
        throw UsageError("--sender-levels must lie between 1 and 10");
    if (!(options.coarse_radius >= 0.0f) || !std::isfinite(options.coarse_radius))
        throw UsageError("--coarse-radius must be positive");
    const int rays = options.links.rays;
    if (rays < 16 || rays > 32768 || !std::has_single_bit(static_cast<unsigned>(rays)))
        throw UsageError("--rays must be a power of two between 16 and 32768");
}

TransferOperator precompute(const Surface& surface, const PrecomputeOptions& options,
                            PrecomputeReport* report) {
    check(options);
    PrecomputeReport local;
    PrecomputeReport& r = report ? *report : local;
    const auto start = Clock::now();

    r.viewpoints = options.viewpoint ? std::vector<Vec3>{*options.viewpoint}
                                     : find_viewpoints(surface, options.seed);
    CandidateSource source(surface, r.viewpoints, options.seed);
    r.mean_ray_length = source.mean_ray_length();

    TransferOperator transfer;
    transfer.sender_levels = options.sender_levels;
    HierarchyOptions hierarchy;
    hierarchy.coarse_radius
        = options.coarse_radius > 0.0f
              ? options.coarse_radius
              : coarsest_share * static_cast<float>(r.mean_ray_length);
    hierarchy.levels = std::max(options.receiver_levels - 1, options.sender_levels);
    hierarchy.display = {std::ldexp(hierarchy.coarse_radius, 1 - options.receiver_levels),
                         options.receiver_levels - 2, options.openness_density};
    hierarchy.shape = options.shape;
    hierarchy.seed = options.seed;
    transfer.points = build_hierarchy(source, hierarchy, &r.hierarchy);
    r.points_seconds = seconds_since(start);
    r.points_rays = source.rays();

    const auto push_start = Clock::now();
    const ShepardBasis basis(transfer.points, surface, options.see_walls);
    transfer.push = make_push_operator(basis);
    r.push_seconds = seconds_since(push_start);

    SenderRows rows(surface, basis, options.sender_levels);
    LinkOptions links = options.links;
    links.seed = options.seed;
    const auto pull_start = Clock::now();
    count_arrivals(surface, rows, transfer.points, options.seed);
    transfer.pull = rows.make_pull_operator();
    r.pull_seconds = seconds_since(pull_start);
    transfer.links = make_links(surface, transfer.points, transfer.push, transfer.pull, rows, links,
                                r.links);
    r.total_seconds = seconds_since(start);
    return transfer;
}

} // namespace afterglow
