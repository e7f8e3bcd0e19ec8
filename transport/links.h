#pragma once

#include "basis/point_hierarchy.h"
#include "basis/push.h"
#include "transport/gather.h"
#include "transport/packed_links.h"

#include <cstdint>
#include <functional>
#include <optional>

namespace afterglow {

struct LinkOptions {
    /// A power of two. A receiver on level l casts R_l / R_L times as many, R_L: the display level's spacing,
    /// as its links must be less noisy where its threshold is lower; of few rays (R_l / R_L)^1.5 times as
    /// many until there are 512 R_l / R_L. Rounded down to a power of two, and never more than most_rays,
    /// or than `rays` where these are more.
    /// On the display level itself 3 / (2 threshold) of 512 suffice, 32 at least, rounded up to a power of two
    /// (usually 256): of so many, three add a link on its threshold. Of more or fewer rays the same share, but
    /// not fewer than these.
    int rays = 512;
    int most_rays = 8192;
    float footprint_angle = 0.02f; // see Footprint
    /// A link d of a receiver on level l to a sender on level k is kept where
    ///
    ///     |d| (R_l / R_L)^2 (R_k / R_0)^(1/2) > threshold,
    ///
    /// and on the display level itself where |d| (R_k / R_0)^(1/2) > 4 threshold.
    /// Receivers: what a coarse one loses, all finer ones lose in the same direction, as bias; what
    /// the display level loses stays where it is, and its links are the noisiest.
    /// Senders: coefficients on level k are of shadow edges, which cross a share of the functions
    /// that goes like R_k, so that their root mean square goes like R_k^(1/2).
    /// Where it is not given and there are fewer than 512 rays, links to all but the coarsest senders must
    /// also exceed 0.8 of what one of the receiver's N rays adds, 2 / N on average: single rays are noise.
    std::optional<float> threshold; // where none is given, link_threshold() makes it from
    double target_error = 0.1;      // the relative error that dropped links may make
    std::uint64_t seed = 1;
    std::function<void(double)> progress = {}; // is told the share of the rays that are done with
};

struct LinkStatistics {
    std::uint64_t rays = 0, links_before = 0; // before: before the threshold
    float threshold = 0.0f;
    double trace_seconds = 0.0, rows_seconds = 0.0, links_seconds = 0.0;
    std::uint64_t patches = 0, uncovered_patches = 0;
};

using LinkRows = std::vector<std::vector<PackedLink>>; // a receiver each

/// Where make_links() can be left and gone on with. Receivers come in the order of their numbers.
struct LinkResumption {
    std::uint32_t done = 0; // the links of the receivers before this one are known:
    Links links;            // these rows; further rows are not looked at
    /// Is called between two batches, with what suffices to go on from there: `done`, and all rows.
    std::function<void(std::uint32_t done, const LinkRows& rows)> pause = {};
};

/// The threshold that is given, or 0.06 target_error min(1, N / 60 000) for N points: what is
/// dropped is a sum of links each below the threshold, so the error is taken to grow in proportion to
/// it; and a scene of few points can have more links to each, its file stays small.
float link_threshold(const LinkOptions& options, const PointHierarchy& points);

/// The rays of the receivers of one level, of so many.
GatherDirections gather_directions(const LinkOptions& options, const PointHierarchy& points,
                                   int level);

/// Gathers the links T_ij of every receiver i: the vector irradiance at i that one unit of sender
/// coefficient j makes [LZT08, eq. (16); with the 1/pi that radiance B/pi brings]. No cosine, no
/// reflectance inside; without a unit. They are differenced on both sides: by the senders above
/// (PullOperator::update), so that a link to a finer sender says only how far the transport of that
/// sender differs from its neighbours', and by the receivers above [LZT08, eq. (17)]. Then they are
/// thresholded. What is dropped of the coarsest senders goes onto those that stay, so that the
/// response to uniform light stays exact.
///
/// Adds to `statistics`. Where it goes on, the sender rows that were made before must be made. What it
/// returns is best joined when the sender rows are gone.
LinkRows make_links(const Surface& surface, const PointHierarchy& points, const PushOperator& push,
                    const PullOperator& pull, SenderRows& rows, const LinkOptions& options,
                    LinkStatistics& statistics, const LinkResumption& resumption = {});

/// Takes twice the memory of the rows for a while.
Links join_links(LinkRows&& rows);
Links join_links(const LinkRows& rows); // twice the memory

} // namespace afterglow
