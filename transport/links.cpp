#include "transport/links.h"

#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/accumulator.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;
using LinkEntry = SparseEntry<LinkValue>;
using LinkVector = Eigen::Vector4f; // x, y, z and a lane that stays zero

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The links of a receiver as its children read them when they predict: all that it and its
/// ancestors stored, summed up by push, but for what is negligible to the children.
struct PushedRow {
    std::vector<std::uint32_t> sender;
    std::vector<LinkVector> value;
};

LinkVector to_float(const LinkValue& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]), 0.0f};
}

/// Thresholds of one receiver level, on the size of a link.
struct LevelThresholds {
    float kept; // what a link must exceed to be stored
    bool has_children;
    float negligible; // what a pushed link must exceed to be predicted for the children
};

/// What a thread needs to turn samples into the row of a receiver.
class RowMaker {
public:
    RowMaker(const PointHierarchy& points, const PushOperator& push, const SenderRows& rows)
        : points_(points), push_(push), rows_(rows), sender_levels_(rows.levels()),
          link_(points.end(rows.levels() - 1), LinkVector::Zero()),
          predicted_(points.end(rows.levels() - 1), LinkVector::Zero()) {}

    /// Fills `kept` with the links of receiver i that are stored, and `pushed` where there are
    /// children. `parents`: the pushed rows of the level above, its first point first.
    void make(Index i, int level, std::span<const GatherSample> samples,
              std::span<const PushedRow> parents, const LevelThresholds& thresholds,
              std::vector<LinkEntry>& kept, PushedRow& pushed, std::uint64_t& links_before) {
        gather(samples);
        if (level > 0) subtract_prediction(i, points_.begin(points_.parent_level[level]), parents);
        threshold(level, thresholds.kept, kept, links_before);
        if (thresholds.has_children) push_down(kept, thresholds.negligible, pushed);
        link_.clear();
        predicted_.clear();
    }

private:
    void add(std::span<const BasisEntry> row, const LinkVector& weight) {
        for (const BasisEntry& entry : row)
            link_.at(entry.index) += entry.value * weight;
    }

    /// Raw links: first to sender values, then, by the transpose of push, to sender coefficients.
    void gather(std::span<const GatherSample> samples) {
        constexpr std::size_t far = 16, near = 8;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            // The rows lie scattered over memory: ask for them while others are added.
            if (k + far < samples.size() && samples[k + far].row != no_index) {
                rows_.prefetch_place(samples[k + far].row);
                if (samples[k + far].finer_row != no_index)
                    rows_.prefetch_place(samples[k + far].finer_row);
            }
            if (k + near < samples.size() && samples[k + near].row != no_index) {
                rows_.prefetch_row(samples[k + near].row);
                if (samples[k + near].finer_row != no_index)
                    rows_.prefetch_row(samples[k + near].finer_row);
            }
            const GatherSample& s = samples[k];
            if (s.row == no_index) continue;
            const LinkVector weight(s.weight.x(), s.weight.y(), s.weight.z(), 0.0f);
            add(rows_.row(s.row), (1.0f - s.finer_share) * weight);
            if (s.finer_row != no_index) add(rows_.row(s.finer_row), s.finer_share * weight);
        }
        for (int l = sender_levels_ - 1; l > 0; --l)
            link_.for_each(points_.begin(l), points_.end(l),
                           [&](std::uint32_t j, const LinkVector& value) {
                               if (value.isZero(0.0f)) return;
                               const auto index = push_.parents.indices(j);
                               const auto weight = push_.parents.values(j);
                               for (std::size_t e = 0; e < index.size(); ++e)
                                   link_.at(index[e]) += weight[e] * value;
                           });
    }

    /// Subtracts what the parents predict.
    void subtract_prediction(Index i, std::uint32_t first_parent,
                             std::span<const PushedRow> parents) {
        const auto index = push_.parents.indices(i);
        const auto weight = push_.parents.values(i);
        for (std::size_t e = 0; e < index.size(); ++e) {
            const PushedRow& row = parents[index[e] - first_parent];
            for (std::size_t k = 0; k < row.sender.size(); ++k)
                predicted_.at(row.sender[k]) += weight[e] * row.value[k];
        }
        predicted_.for_each(
            0, points_.end(sender_levels_ - 1),
            [&](std::uint32_t j, const LinkVector& value) { link_.at(j) -= value; });
    }

    /// Moves to `kept` what is stored of link_.
    void threshold(int level, float smallest, std::vector<LinkEntry>& kept,
                   std::uint64_t& links_before) {
        const std::uint32_t coarsest = points_.end(0), all = points_.end(sender_levels_ - 1);
        // The coarsest senders: what is dropped of them goes onto those that stay, in proportion to
        // their size; more stay, the largest first, until what is dropped is itself small.
        candidates_.clear();
        LinkVector dropped = LinkVector::Zero();
        link_.for_each(0, coarsest, [&](std::uint32_t j, const LinkVector& d) {
            const float size = d.norm();
            if (size == 0.0f) return;
            candidates_.push_back({size, j});
            dropped += d;
        });
        std::sort(candidates_.begin(), candidates_.end(),
                  [](const Candidate& a, const Candidate& b) {
                      return a.size != b.size ? a.size > b.size : a.sender < b.sender;
                  });
        std::size_t stay = 0;
        float stay_size = 0.0f;
        while (stay < candidates_.size()
               && (level == 0 || candidates_[stay].size > smallest || dropped.norm() > smallest)) {
            dropped -= link_.at(candidates_[stay].sender);
            stay_size += candidates_[stay++].size;
        }
        candidates_.resize(stay);
        std::sort(candidates_.begin(), candidates_.end(),
                  [](const Candidate& a, const Candidate& b) { return a.sender < b.sender; });
        for (const Candidate& c : candidates_)
            store(c.sender, link_.at(c.sender) + (c.size / stay_size) * dropped, kept);

        link_.for_each(0, all, [&](std::uint32_t j, const LinkVector& d) {
            const float size2 = d.squaredNorm();
            if (size2 == 0.0f) return;
            ++links_before;
            if (j >= coarsest && size2 > smallest * smallest) store(j, d, kept);
        });
    }

    static void store(std::uint32_t sender, const LinkVector& d, std::vector<LinkEntry>& kept) {
        kept.push_back({sender, {Eigen::half(d.x()), Eigen::half(d.y()), Eigen::half(d.z())}});
    }

    /// Prediction and stored links together. Links to the coarsest senders all stay, so that the
    /// response to uniform light is exact on every level.
    void push_down(const std::vector<LinkEntry>& kept, float negligible, PushedRow& pushed) {
        for (const LinkEntry& link : kept)
            predicted_.at(link.index) += to_float(link.value);
        const std::uint32_t coarsest = points_.end(0);
        predicted_.for_each(
            0, points_.end(sender_levels_ - 1), [&](std::uint32_t j, const LinkVector& value) {
                const float size2 = value.squaredNorm();
                if (size2 == 0.0f || (j >= coarsest && size2 < negligible * negligible)) return;
                pushed.sender.push_back(j);
                pushed.value.push_back(value);
            });
    }

    const PointHierarchy& points_;
    const PushOperator& push_;
    const SenderRows& rows_;
    int sender_levels_;
    Accumulator<LinkVector> link_;
    Accumulator<LinkVector> predicted_;
    struct Candidate {
        float size;
        std::uint32_t sender;
    };
    std::vector<Candidate> candidates_;
};

} // namespace

GatherDirections gather_directions(const LinkOptions& options, const PointHierarchy& points,
                                   int level) {
    const int coarser =
        static_cast<int>(std::lround(std::log2(points.spacing[level] / points.spacing.back())));
    const std::int64_t rays = static_cast<std::int64_t>(options.rays) << std::max(0, coarser);
    return {
        static_cast<int>(std::min<std::int64_t>(std::max(options.most_rays, options.rays), rays)),
        hash64(options.seed, static_cast<std::uint64_t>(level))};
}

Links make_links(const Surface& surface, const PointHierarchy& points, const PushOperator& push,
                 SenderRows& rows, const LinkOptions& options, LinkStatistics& statistics) {
    constexpr Index samples_at_once = 1 << 20, grain = 16;
    std::vector<std::vector<LinkEntry>> done(points.size());
    std::vector<PushedRow> parents, pushed;
    std::vector<GatherSample> samples;
    std::vector<std::uint32_t> needed;
    const Footprint footprint{options.footprint_angle, points.spacing[0], rows.levels()};
    const int display = points.levels() - 1;
    const auto kept_size = [&](int level) {
        const float finer = points.spacing.back() / points.spacing[level];
        return options.threshold * finer * finer * finer;
    };
    for (int l = 0; l < points.levels(); ++l) {
        statistics.links.push_back(0);
        if (!points.leads_to_display(l)) continue; // senders alone
        const GatherDirections directions = gather_directions(options, points, l);
        // A pushed link an eighth of the children's threshold decides nothing there.
        const int children = l == points.parent_level[display] ? display : l + 1;
        const LevelThresholds thresholds{kept_size(l), l != display,
                                         l == display ? 0.0f : 0.125f * kept_size(children)};
        parents = std::move(pushed);
        pushed.assign(points.end(l) - points.begin(l), {});
        const Index batch = std::max<Index>(grain, samples_at_once / directions.rays());
        std::vector<std::uint64_t> before(static_cast<std::size_t>((batch + grain - 1) / grain));
        for (Index begin = points.begin(l); begin < points.end(l); begin += batch) {
            const Index end = std::min<Index>(begin + batch, points.end(l));
            auto start = Clock::now();
            trace_gather(surface, rows, points, begin, end, points.begin(l), directions, footprint,
                         samples);
            statistics.trace_seconds += seconds_since(start);
            statistics.rays += samples.size();

            start = Clock::now();
            needed.clear();
            for (const GatherSample& s : samples) {
                needed.push_back(s.row);
                needed.push_back(s.finer_row);
            }
            rows.require(needed);
            statistics.rows_seconds += seconds_since(start);

            start = Clock::now();
            std::fill(before.begin(), before.end(), 0);
            parallel_ranges(end - begin, grain, [&](Index first, Index last) {
                RowMaker maker(points, push, rows);
                for (Index r = first; r < last; ++r)
                    maker.make(
                        begin + r, l,
                        std::span(samples).subspan(static_cast<std::size_t>(r) * directions.rays(),
                                                   static_cast<std::size_t>(directions.rays())),
                        parents, thresholds, done[begin + r], pushed[begin + r - points.begin(l)],
                        before[first / grain]);
            });
            for (const std::uint64_t b : before)
                statistics.links_before += b;
            statistics.links_seconds += seconds_since(start);
        }
        for (Index i = points.begin(l); i < points.end(l); ++i)
            statistics.links.back() += done[i].size();
    }
    statistics.patches = rows.made();
    statistics.uncovered_patches = rows.uncovered();
    return join_rows(std::move(done));
}

} // namespace afterglow
