#include "transport/precompute.h"

#include "basis/poisson_disk.h"
#include "core/error.h"
#include "core/seconds.h"
#include "transport/checkpoint.h"
#include "transport/paper_links.h"
#include "transport/paper_series.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <optional>

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;

/// The coarsest spacing as a share of the typical ray length: a few functions a room. With the
/// default levels the finest senders are 1/25 of that length apart.
constexpr float coarsest_share = 1.28f;

constexpr double points_share = 0.2, push_share = 0.05; // of the time, roughly

/// That spacing times this, 1 or less: so that the display level has at least 30 000 points on open
/// ground in a scene of few surfaces too.
float finer_for_few_surfaces(CandidateSource& source, float coarse_radius, int receiver_levels) {
    constexpr double fewest = 30'000.0;
    constexpr int counted_level = 2;
    const PoissonDisk counted =
        poisson_disk(source, {.spacing = std::ldexp(coarse_radius, -counted_level),
                              .placement_power = BasisShape().placement_power});
    const double expected = std::ldexp(static_cast<double>(counted.points.size()),
                                       2 * (receiver_levels - 1 - counted_level));
    return static_cast<float>(std::min(1.0, std::sqrt(expected / fewest)));
}

HierarchyOptions hierarchy_options(const PrecomputeOptions& options, CandidateSource& source) {
    HierarchyOptions hierarchy;
    if (options.progress)
        hierarchy.progress = [&](double share) { options.progress(points_share * share); };
    hierarchy.coarse_radius = options.coarse_radius;
    if (options.coarse_radius == 0.0f) {
        hierarchy.coarse_radius = coarsest_share * static_cast<float>(source.mean_ray_length());
        if (options.kind == OperatorKind::neumann)
            hierarchy.coarse_radius *= finer_for_few_surfaces(source, hierarchy.coarse_radius,
                                                              options.receiver_levels);
        hierarchy.coarse_radius *= options.coarse_scale;
    }
    if (options.kind == OperatorKind::paper) {
        hierarchy.levels = options.receiver_levels;
        hierarchy.shape = BasisShape::paper();
        hierarchy.candidates_per_point = 500; // about where 2000 in a row fail for the first time
    } else {
        hierarchy.levels = std::max(options.receiver_levels - 1, options.sender_levels);
        hierarchy.finest_density = options.sender_density;
        hierarchy.display = {std::ldexp(hierarchy.coarse_radius, 1 - options.receiver_levels),
                             options.receiver_levels - 2, options.openness_density};
    }
    return hierarchy;
}

/// Of a receiver, as PrecomputeOptions::coarse_scale has it.
int rays_at_scale(const PrecomputeOptions& options) {
    constexpr int fewest = 128;
    const int rays = options.links.rays;
    if (options.coarse_radius > 0.0f || options.coarse_scale <= 1.0f) return rays;
    const double wanted = rays * std::pow(options.coarse_scale, -1.5);
    const int nearest = 1 << static_cast<int>(std::log2(wanted) + 0.49); // in the middle: the lower
    return std::max(nearest, std::min(rays, fewest));
}

/// Goes on from `begun` where that is given: then of `transfer`, all but the links is there.
void make_neumann(const Surface& surface, const LinkOptions& links, Checkpoint* checkpoint,
                  const Checkpoint::State* begun, TransferOperator& transfer, PrecomputeReport& report) {
    auto start = Clock::now();
    const ShepardBasis basis(transfer.points, surface, true);
    if (!begun) transfer.push = make_push_operator(basis);
    report.push_seconds = seconds_since(start);

    start = Clock::now();
    std::optional<SenderRows> rows(std::in_place, surface, basis, transfer.sender_levels);
    rows->see(arrivals(surface, transfer.points, links.seed));
    LinkResumption resumption;
    if (begun) {
        if (!begun->made_rows.empty() && std::ranges::max(begun->made_rows) >= rows->count())
            throw FileError(checkpoint->path(), "names sender rows that are not there");
        rows->require(begun->made_rows);
        resumption.done = begun->done;
        resumption.links = transfer.links;
    } else {
        transfer.pull = rows->make_pull_operator();
    }
    report.pull_seconds = seconds_since(start);
    if (checkpoint) {
        const auto save = [&](std::uint32_t done, const LinkRows& of_receivers) {
            transfer.links = join_links(of_receivers); // for this alone: they take as much as the rows
            transfer.sender_areas.assign(transfer.senders() - transfer.points.begin(transfer.sender_levels - 1), 0.0f);
            checkpoint->save(transfer, done, rows->made_numbers(), report);
            transfer.links = {};
        };
        if (!begun) save(0, LinkRows(transfer.points.size()));
        resumption.pause = [=](std::uint32_t done, const LinkRows& of_receivers) {
            if (checkpoint->is_due()) save(done, of_receivers);
        };
    }
    LinkRows rows_of_links = make_links(surface, transfer.points, transfer.push, transfer.pull, *rows, links,
                                        report.links, resumption);
    transfer.sender_areas = rows->finest_areas();
    rows.reset();
    transfer.links = join_links(std::move(rows_of_links));
}

void make_paper(const Surface& surface, const LinkOptions& links, TransferOperator& transfer,
                PrecomputeReport& report) {
    auto start = Clock::now();
    const ShepardBasis basis(transfer.points, surface, false);
    transfer.pyramid = make_pyramid(basis, transfer.sender_levels);
    report.push_seconds = seconds_since(start);

    start = Clock::now();
    transfer.pull = make_point_pull(basis, transfer.sender_levels);
    report.pull_seconds = seconds_since(start);
    RgbLinks one_bounce =
        make_paper_links(surface, basis, transfer.sender_levels, links, report.links);

    start = Clock::now();
    transfer.solution =
        make_paper_series(std::move(one_bounce), basis, transfer.sender_levels, transfer.pyramid,
                          transfer.pull, transfer.bounces, report.links.threshold);
    report.series_seconds = seconds_since(start);
}

} // namespace

PrecomputeOptions PrecomputeOptions::paper() {
    PrecomputeOptions options;
    options.kind = OperatorKind::paper;
    options.sender_levels = 3;
    options.bounces = 4;
    options.links.threshold = 0.025f / static_cast<float>(EIGEN_PI);
    return options;
}

void check(const PrecomputeOptions& options) {
    if (options.receiver_levels < 2 || options.receiver_levels > 10)
        throw UsageError("--receiver-levels must lie between 2 and 10");
    if (options.sender_levels < 1 || options.sender_levels > 10)
        throw UsageError("--sender-levels must lie between 1 and 10");
    if (!(options.coarse_radius >= 0.0f && options.coarse_radius <= largest_coordinate))
        throw UsageError("--coarse-radius must be positive, and 1e12 at most");
    if (options.viewpoint && !is_reachable(*options.viewpoint))
        throw UsageError("--viewpoint must be within 1e12 of the origin");
    const int rays = options.links.rays;
    if (rays < 16 || rays > 32768 || !std::has_single_bit(static_cast<unsigned>(rays)))
        throw UsageError("--rays must be a power of two between 16 and 32768");
    if (options.kind == OperatorKind::paper) {
        if (options.sender_levels > options.receiver_levels)
            throw UsageError("--operator paper has at most as many levels of senders as of receivers");
        if (options.bounces < 1)
            throw UsageError("--operator paper stores a number of bounces: --bounces must be positive");
        if (!options.links.threshold) throw UsageError("--operator paper needs --epsilon");
    }
}

TransferOperator precompute(const Surface& surface, const PrecomputeOptions& options,
                            PrecomputeReport* report) {
    check(options);
    PrecomputeReport local;
    PrecomputeReport& r = report ? *report : local;
    const auto start = Clock::now();

    TransferOperator transfer;
    std::optional<Checkpoint::State> begun;
    if (options.checkpoint) begun = options.checkpoint->take(options.coarse_scale);
    if (begun) {
        r = begun->report;
        transfer = std::move(begun->transfer);
    } else {
        r.viewpoints = options.viewpoint ? std::vector<Vec3>{*options.viewpoint}
                                         : find_viewpoints(surface, options.seed);
        CandidateSource source(surface, r.viewpoints, options.seed);
        r.mean_ray_length = source.mean_ray_length();
        transfer.kind = options.kind;
        transfer.sender_levels = options.sender_levels;
        transfer.bounces = options.bounces;
        transfer.points =
            build_hierarchy(source, hierarchy_options(options, source), &r.hierarchy);
        r.points_rays = source.rays();
    }
    r.points_seconds = seconds_since(start);

    LinkOptions links = options.links;
    links.seed = options.seed;
    links.rays = rays_at_scale(options);
    if (options.progress)
        links.progress = [&](double share) {
            options.progress(std::lerp(points_share + push_share, 1.0, share));
        };
    if (options.kind == OperatorKind::paper)
        make_paper(surface, links, transfer, r);
    else
        make_neumann(surface, links, options.checkpoint, begun ? &*begun : nullptr, transfer, r);
    r.total_seconds = seconds_since(start);
    return transfer;
}

} // namespace afterglow
