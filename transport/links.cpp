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

/// A stored row as its descendants read it when they predict.
struct AncestorRow {
    std::vector<std::uint32_t> sender; // the coarsest senders in front, then all others,
    std::vector<LinkVector> value;     // the largest first
    std::size_t coarsest = 0;          // how many stand in front
};

LinkVector to_float(const LinkValue& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2]), 0.0f};
}

AncestorRow make_ancestor_row(const std::vector<LinkEntry>& kept, std::uint32_t coarsest_senders) {
    struct Sized {
        float size2;
        std::uint32_t place;
    };
    AncestorRow row;
    std::vector<Sized> order;
    for (std::uint32_t k = 0; k < kept.size(); ++k) {
        const bool coarsest = kept[k].index < coarsest_senders;
        row.coarsest += coarsest;
        order.push_back({coarsest ? std::numeric_limits<float>::infinity()
                                  : to_float(kept[k].value).squaredNorm(),
                         k});
    }
    std::stable_sort(order.begin(), order.end(),
                     [](const Sized& a, const Sized& b) { return a.size2 > b.size2; });
    for (const Sized& s : order) {
        row.sender.push_back(kept[s.place].index);
        row.value.push_back(to_float(kept[s.place].value));
    }
    return row;
}

/// What a thread needs to turn samples into the row of a receiver.
class RowMaker {
public:
    RowMaker(const PointHierarchy& points, const PushOperator& push, const SenderRows& rows)
        : points_(points), push_(push), rows_(rows), sender_levels_(rows.levels()),
          link_(points.end(rows.levels() - 1), LinkVector::Zero()),
          ancestor_(points.size(), 0.0f) {}

    /// The kept links of receiver i on `level`. `ancestors`: rows of all coarser levels.
    void make(Index i, int level, std::span<const GatherSample> samples,
              const std::vector<AncestorRow>& ancestors, float smallest, std::vector<LinkEntry>& kept,
              std::uint64_t& links_before) {
        gather(samples);
        subtract_prediction(i, level, ancestors, smallest);
        threshold(level, smallest, kept, links_before);
        link_.clear();
    }

private:
    void add(std::span<const BasisEntry> row, const LinkVector& weight) {
        for (const BasisEntry& entry : row) link_.at(entry.index) += entry.value * weight;
    }

    /// Raw links: first to sender values, then, by the transpose of push, to sender coefficients.
    void gather(std::span<const GatherSample> samples) {
        constexpr std::size_t far = 16, near = 8;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            // The rows lie scattered over memory: ask for them while others are added.
            if (k + far < samples.size() && samples[k + far].row != no_index) {
                rows_.prefetch_place(samples[k + far].row);
                if (samples[k + far].finer_row != no_index) rows_.prefetch_place(samples[k + far].finer_row);
            }
            if (k + near < samples.size() && samples[k + near].row != no_index) {
                rows_.prefetch_row(samples[k + near].row);
                if (samples[k + near].finer_row != no_index) rows_.prefetch_row(samples[k + near].finer_row);
            }
            const GatherSample& s = samples[k];
            if (s.row == no_index) continue;
            const LinkVector weight(s.weight.x(), s.weight.y(), s.weight.z(), 0.0f);
            add(rows_.row(s.row), (1.0f - s.finer_share) * weight);
            if (s.finer_row != no_index) add(rows_.row(s.finer_row), s.finer_share * weight);
        }
        for (int l = sender_levels_ - 1; l > 0; --l)
            link_.for_each(points_.begin(l), points_.end(l), [&](std::uint32_t j, const LinkVector& value) {
                if (value.isZero(0.0f)) return;
                const auto index = push_.parents.indices(j);
                const auto weight = push_.parents.values(j);
                for (std::size_t e = 0; e < index.size(); ++e) link_.at(index[e]) += weight[e] * value;
            });
    }

    /// Subtracts what the stored rows of all ancestors predict by push. Links far below the
    /// receiver's own threshold decide nothing and are passed over; those of the coarsest senders all
    /// count, because the response to uniform light must stay exact.
    void subtract_prediction(Index i, int level, const std::vector<AncestorRow>& ancestors,
                             float smallest) {
        constexpr float negligible_share = 0.125f;
        const float negligible2 = negligible_share * negligible_share * smallest * smallest;
        const auto index = push_.parents.indices(i);
        const auto weight = push_.parents.values(i);
        for (std::size_t e = 0; e < index.size(); ++e) ancestor_.at(index[e]) += weight[e];
        for (int l = level - 1; l >= 0; --l)
            ancestor_.for_each(points_.begin(l), points_.end(l), [&](std::uint32_t k, float share) {
                if (share == 0.0f) return;
                const AncestorRow& row = ancestors[k];
                for (std::size_t e = 0; e < row.sender.size(); ++e) {
                    if (e >= row.coarsest && row.value[e].squaredNorm() < negligible2) break;
                    link_.at(row.sender[e]) -= share * row.value[e];
                }
                const auto above = push_.parents.indices(k);
                const auto part = push_.parents.values(k);
                for (std::size_t e = 0; e < above.size(); ++e) ancestor_.at(above[e]) += share * part[e];
            });
        ancestor_.clear();
    }

    void threshold(int level, float smallest, std::vector<LinkEntry>& kept, std::uint64_t& links_before) {
        const std::uint32_t coarsest = points_.end(0), all = points_.end(sender_levels_ - 1);
        const float smallest2 = smallest * smallest;
        LinkVector dropped = LinkVector::Zero();
        float kept_size = 0.0f;
        link_.for_each(0, coarsest, [&](std::uint32_t, const LinkVector& d) {
            const float d2 = d.squaredNorm();
            if (level == 0 || d2 > smallest2)
                kept_size += std::sqrt(d2);
            else
                dropped += d;
        });
        if (kept_size > 0.0f) dropped /= kept_size;
        link_.for_each(0, all, [&](std::uint32_t j, const LinkVector& d) {
            const float d2 = d.squaredNorm();
            if (d2 == 0.0f) return;
            ++links_before;
            const bool keep = d2 > smallest2 || (level == 0 && j < coarsest);
            if (!keep) return;
            const LinkVector value = j < coarsest ? LinkVector(d + std::sqrt(d2) * dropped) : d;
            kept.push_back({j, {Eigen::half(value.x()), Eigen::half(value.y()), Eigen::half(value.z())}});
        });
    }

    const PointHierarchy& points_;
    const PushOperator& push_;
    const SenderRows& rows_;
    int sender_levels_;
    Accumulator<LinkVector> link_;
    Accumulator<float> ancestor_;
};

} // namespace

Links make_links(const Surface& surface, const PointHierarchy& points, const PushOperator& push,
                 SenderRows& rows, const LinkOptions& options, LinkStatistics& statistics) {
    constexpr Index samples_at_once = 1 << 20, grain = 16;
    std::vector<std::vector<LinkEntry>> done(points.size());
    std::vector<AncestorRow> ancestors(points.begin(points.levels() - 1));
    std::vector<GatherSample> samples;
    std::vector<std::uint32_t> needed;
    const Footprint footprint{options.footprint_angle, points.spacing[0], rows.levels()};
    for (int l = 0; l < points.levels(); ++l) {
        const GatherDirections directions(
            std::min(std::max(options.most_rays, options.rays), options.rays << (points.levels() - 1 - l)),
            hash64(options.seed, static_cast<std::uint64_t>(l)));
        const float smallest = options.threshold * std::pow(points.spacing.back() / points.spacing[l], options.level_power);
        const Index batch = std::max<Index>(grain, samples_at_once / directions.rays());
        std::vector<std::uint64_t> before(static_cast<std::size_t>((batch + grain - 1) / grain));
        for (Index begin = points.begin(l); begin < points.end(l); begin += batch) {
            const Index end = std::min<Index>(begin + batch, points.end(l));
            auto start = Clock::now();
            trace_gather(surface, rows, points, begin, end, points.begin(l), directions,
                         footprint, samples);
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
                    maker.make(begin + r, l,
                               std::span(samples).subspan(static_cast<std::size_t>(r) * directions.rays(),
                                                          static_cast<std::size_t>(directions.rays())),
                               ancestors, smallest, done[begin + r], before[first / grain]);
            });
            for (const std::uint64_t b : before) statistics.links_before += b;
            statistics.links_seconds += seconds_since(start);
        }
        if (l + 1 < points.levels())
            parallel_for(points.end(l) - points.begin(l), [&](Index k) {
                ancestors[points.begin(l) + k] = make_ancestor_row(done[points.begin(l) + k], points.end(0));
            });
        statistics.links.push_back(0);
        for (Index i = points.begin(l); i < points.end(l); ++i) statistics.links.back() += done[i].size();
    }
    statistics.patches = rows.made();
    statistics.uncovered_patches = rows.uncovered();
    return join_rows(std::move(done));
}

} // namespace afterglow
