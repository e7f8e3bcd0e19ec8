#include "transport/links.h"

#include "core/parallel.h"
#include "core/sampling.h"
#include "core/seconds.h"
#include "transport/accumulator.h"
#include "transport/pushed_links.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;
/// The links of a receiver as its children read them when they predict: all that it and its
/// ancestors stored, summed up by push, but for what is negligible to the children.
using PushedRow = std::vector<PushedLink>;

/// Links of the display level must exceed so many thresholds.
constexpr float display_threshold = 4.0f;

/// Thresholds of one receiver level, on the size of a link.
struct LevelThresholds {
    std::vector<float> kept; // a sender level: what a link must exceed to be stored
    bool has_children;
    float negligible; // what a pushed link must exceed to be predicted for the children
};

/// What a thread needs to turn samples into the row of a receiver.
class RowMaker {
public:
    RowMaker(const PointHierarchy& points, const PushOperator& push, const PullOperator& pull,
             const SenderRows& rows)
        : points_(points), push_(push), pull_(pull), rows_(rows), sender_levels_(rows.levels()),
          link_(points.end(rows.levels() - 1), LinkVector::Zero()),
          predicted_(points.end(rows.levels() - 1), LinkVector::Zero()) {}

    /// Fills `kept` with the links of receiver i that are stored, and `pushed` where there are
    /// children. `parents`: the pushed rows of the level above, its first point first. Adds how many
    /// there were to `links_before`.
    void make(Index i, int level, std::span<const GatherSample> samples,
              std::span<const PushedRow> parents, const LevelThresholds& thresholds,
              std::vector<PackedLink>& kept, PushedRow& pushed, std::uint64_t& links_before) {
        gather(samples);
        difference_senders(thresholds.kept[0]);
        if (level > 0) subtract_prediction(i, points_.begin(points_.parent_level[level]), parents);
        kept_.clear();
        threshold(level, thresholds.kept, links_before);
        kept = std::vector<PackedLink>(kept_); // no larger than it must be
        if (thresholds.has_children) push_down(thresholds.negligible, pushed);
        clear();
    }

    /// Fills `pushed` as make() did when it stored these links of receiver i.
    void push_again(Index i, int level, const Links& links, std::span<const PushedRow> parents, float negligible,
                    PushedRow& pushed) {
        if (level > 0) subtract_prediction(i, points_.begin(points_.parent_level[level]), parents);
        links.for_each(i, [&](std::uint32_t j, const LinkVector& d) { predicted_.at(j) += d; });
        push_down(negligible, pushed);
        clear();
    }

private:
    void clear() {
        link_.clear();
        predicted_.clear();
    }

    /// Raw links: first to sender values, then, by the transpose of push, to sender coefficients.
    void gather(std::span<const GatherSample> samples) {
        constexpr std::size_t far = 16, near = 8;
        for (std::size_t k = 0; k < samples.size(); ++k) {
            // The rows lie scattered over memory: ask for them while others are added.
            if (k + far < samples.size() && samples[k + far].row != no_index)
                rows_.prefetch_begin(samples[k + far].row);
            if (k + near < samples.size() && samples[k + near].row != no_index)
                rows_.prefetch_row(samples[k + near].row);
            const GatherSample& s = samples[k];
            if (s.row == no_index) continue;
            const LinkVector weight(s.weight.x(), s.weight.y(), s.weight.z(), 0.0f);
            for (const BasisEntry& entry : rows_.at(s.row))
                link_.at(entry.index) += entry.value * weight;
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

    /// From coefficients to updated coefficients, see PullOperator::update. Links this small have no
    /// children that are kept.
    void difference_senders(float negligible) {
        for (int l = sender_levels_ - 1; l > 0; --l)
            link_.for_each(points_.begin(l - 1), points_.end(l - 1),
                           [&](std::uint32_t k, const LinkVector& value) {
                               if (value.squaredNorm() <= negligible * negligible) return;
                               const auto index = pull_.children.indices(k);
                               const auto share = pull_.children.values(k);
                               for (std::size_t e = 0; e < index.size(); ++e)
                                   link_.at(index[e]) -= share[e] * value;
                           });
    }

    /// Subtracts what the parents predict.
    void subtract_prediction(Index i, std::uint32_t first_parent,
                             std::span<const PushedRow> parents) {
        const auto index = push_.parents.indices(i);
        const auto weight = push_.parents.values(i);
        for (std::size_t e = 0; e < index.size(); ++e) {
            for_each_pushed(parents[index[e] - first_parent], [&](std::uint32_t j, const LinkVector& value) {
                predicted_.at(j) += weight[e] * value;
            });
        }
        predicted_.for_each(
            0, points_.end(sender_levels_ - 1),
            [&](std::uint32_t j, const LinkVector& value) { link_.at(j) -= value; });
    }

    /// Moves to kept_ what is stored of link_, and adds it to predicted_.
    void threshold(int level, const std::vector<float>& smallest, std::uint64_t& links_before) {
        const auto store = [&](std::uint32_t j, const LinkVector& d) {
            const LinkVector value = packer_.append(j, d, kept_);
            if (!value.isZero(0.0f)) predicted_.at(j) += value;
        };
        // The coarsest senders: what is dropped goes onto those that stay, in proportion to their
        // size. One stays, the largest, where all together are not small. The coarsest receivers
        // keep all.
        float largest = 0.0f;
        LinkVector total = LinkVector::Zero();
        link_.for_each(0, points_.end(0), [&](std::uint32_t, const LinkVector& d) {
            links_before += !d.isZero(0.0f);
            largest = std::max(largest, d.norm());
            total += d;
        });
        float limit = level == 0 ? 0.0f : smallest[0];
        if (largest <= limit && total.norm() > limit) limit = std::nextafter(largest, 0.0f);
        float stay_size = 0.0f;
        LinkVector dropped = LinkVector::Zero();
        link_.for_each(0, points_.end(0), [&](std::uint32_t, const LinkVector& d) {
            if (d.norm() > limit) stay_size += d.norm();
            else dropped += d;
        });
        // What rounding adds or takes goes on to the next smaller one, so that their sum is right to
        // half a step of the smallest.
        coarsest_.clear();
        link_.for_each(0, points_.end(0), [&](std::uint32_t j, const LinkVector& d) {
            if (d.norm() > limit)
                coarsest_.push_back({d.norm(), j, d + (d.norm() / stay_size) * dropped});
        });
        std::sort(coarsest_.begin(), coarsest_.end(), [](const Coarsest& a, const Coarsest& b) {
            return a.size != b.size ? a.size > b.size : a.sender < b.sender;
        });
        LinkVector rest = LinkVector::Zero();
        for (Coarsest& c : coarsest_) {
            const LinkVector wanted = c.link + rest;
            c.link = LinkPacker::rounded(wanted);
            rest = wanted - c.link;
        }
        std::sort(coarsest_.begin(), coarsest_.end(),
                  [](const Coarsest& a, const Coarsest& b) { return a.sender < b.sender; });
        for (const Coarsest& c : coarsest_)
            store(c.sender, c.link);

        for (int k = 1; k < sender_levels_; ++k)
            link_.for_each(points_.begin(k), points_.end(k),
                           [&](std::uint32_t j, const LinkVector& d) {
                               const float size2 = d.squaredNorm();
                               links_before += size2 > 0.0f;
                               if (size2 > smallest[k] * smallest[k]) store(j, d);
                           });
    }

    /// Prediction and stored links together, less what is small. Links to the coarsest senders all
    /// stay, so that the response to uniform light is exact on every level.
    void push_down(float negligible, PushedRow& pushed) {
        const std::uint32_t coarsest = points_.end(0);
        pushed_.clear();
        predicted_.for_each(
            0, points_.end(sender_levels_ - 1), [&](std::uint32_t j, const LinkVector& value) {
                const float size2 = value.squaredNorm();
                if (size2 == 0.0f || (j >= coarsest && size2 < negligible * negligible)) return;
                pushed_packer_.append(j, value, pushed_);
            });
        pushed = PushedRow(pushed_); // likewise
    }

    const PointHierarchy& points_;
    const PushOperator& push_;
    const PullOperator& pull_;
    const SenderRows& rows_;
    int sender_levels_;
    Accumulator<LinkVector> link_;
    Accumulator<LinkVector> predicted_;
    LinkPacker packer_;
    PushedLinkPacker pushed_packer_;
    std::vector<PackedLink> kept_; // of the receiver that is being made
    PushedRow pushed_;
    struct Coarsest {
        float size;
        std::uint32_t sender;
        LinkVector link;
    };
    std::vector<Coarsest> coarsest_;
};

/// Of what a ray of mean density adds: links below are taken for noise. The differences of single rays
/// are few large ones on one side and many small ones on the other, so that a threshold that only the
/// large ones exceed adds light (14 % at 128 rays); and one above what a ray adds loses some.
constexpr float least_share_of_a_ray = 0.8f;

/// smallest: that any link to a finer sender may be, see LinkOptions.
LevelThresholds level_thresholds(float threshold, const PointHierarchy& points, int sender_levels,
                                 int level, float smallest) {
    const int display = points.levels() - 1;
    const auto receiver = [&](int l) {
        const float finer = points.spacing.back() / points.spacing[l];
        return threshold * (l == display ? display_threshold : finer * finer);
    };
    LevelThresholds thresholds{{}, level != display, 0.0f};
    for (int k = 0; k < sender_levels; ++k)
        thresholds.kept.push_back(std::max(receiver(level) * std::sqrt(points.spacing[0] / points.spacing[k]),
                                           k > 0 ? smallest : 0.0f));
    if (thresholds.has_children) {
        // A pushed link an eighth of the children's threshold decides nothing there.
        thresholds.negligible =
            0.125f * receiver(level == points.parent_level[display] ? display : level + 1);
    }
    return thresholds;
}

/// Of a display receiver, see LinkOptions; so many that a link on its threshold is three rays, which add
/// 2 / N each on average; of fewer, walls are speckled.
int display_rays(const LinkOptions& options, const PointHierarchy& points) {
    constexpr double least = 32.0; // however few links are kept
    const double suffice = std::max(least, 3.0 * 2.0 / (display_threshold * link_threshold(options, points)));
    const double of_usual = std::exp2(std::ceil(std::log2(suffice) - 0.01));
    const double share = std::min(1.0, of_usual / std::min(options.rays, LinkOptions().rays));
    return static_cast<int>(share * options.rays);
}

/// Of a receiver of a level; see LinkOptions.
int gather_rays(const LinkOptions& options, const PointHierarchy& points, int level) {
    if (level + 1 == points.levels()) return display_rays(options, points);
    const double ratio = std::max(1.0f, points.spacing[level] / points.spacing.back());
    const double least = options.rays * ratio;
    const double wanted = std::clamp(options.rays * std::pow(ratio, 1.5), least,
                                     std::max(least, LinkOptions().rays * ratio));
    const auto most = static_cast<double>(std::max(options.rays, options.most_rays));
    return 1 << static_cast<int>(std::log2(std::min(wanted, most)) + 0.01);
}

/// Rays of all receivers.
std::uint64_t rays_of_all(const LinkOptions& options, const PointHierarchy& points) {
    std::uint64_t rays = 0;
    for (int l = 0; l < points.levels(); ++l)
        if (points.leads_to_display(l))
            rays += static_cast<std::uint64_t>(points.end(l) - points.begin(l))
                    * static_cast<std::uint64_t>(gather_rays(options, points, l));
    return rays;
}

/// Makes the rows at the ends of these rays, those of a range of samples at a time, in order, and puts
/// their places in the stead of their numbers.
void require_rows(std::span<GatherSample> samples, SenderRows& rows) {
    constexpr Index grain = 8192;
    std::vector<std::vector<GatherSample*>> missing(samples.size() / grain + 1);
    parallel_ranges(static_cast<Index>(samples.size()), grain, [&](Index first, Index last) {
        for (GatherSample& s : samples.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(last - first))) {
            if (s.row == no_index) continue;
            if (rows.is_made(s.row)) s.row = rows.place(s.row);
            else missing[static_cast<std::size_t>(first / grain)].push_back(&s);
        }
    });
    std::vector<std::uint32_t> needed;
    for (const auto& of_range : missing)
        for (const GatherSample* s : of_range) needed.push_back(s->row);
    rows.require(needed);
    for (const auto& of_range : missing)
        for (GatherSample* s : of_range) s->row = rows.place(s->row);
}

/// Makes all links: level by level, since children need their parents' rows, and a batch of receivers at a
/// time, so that few samples are held at once.
class LinkMaker {
public:
    LinkMaker(const Surface& surface, const PointHierarchy& points, const PushOperator& push,
              const PullOperator& pull, SenderRows& rows, const LinkOptions& options,
              LinkStatistics& statistics, const LinkResumption& resumption)
        : surface_(surface), points_(points), push_(push), rows_(rows), options_(options),
          statistics_(statistics), resumption_(resumption), first_to_do_(resumption.done),
          makers_([&] { return std::make_unique<RowMaker>(points, push, pull, rows); }),
          links_(points.size()) {
        statistics.threshold = link_threshold(options, points);
    }

    LinkRows make() {
        for (int l = 0; l < points_.levels(); ++l)
            if (points_.leads_to_display(l)) make_level(l); // not senders alone
        statistics_.patches = rows_.made();
        statistics_.uncovered_patches = rows_.uncovered();
        return std::move(links_);
    }

private:
    struct Level {
        int number;
        Index begin;
        GatherDirections directions;
        LevelThresholds thresholds;
    };
    static constexpr Index grain = 16; // receivers that a thread takes at a time

    void make_level(int l) {
        constexpr Index samples_of_a_thread = 1 << 17;
        const GatherDirections directions = gather_directions(options_, points_, l);
        const bool noisy = !options_.threshold && options_.rays < LinkOptions().rays;
        const float of_one_ray = 2.0f / static_cast<float>(directions.rays());
        const Level level{l, points_.begin(l), directions,
                          level_thresholds(statistics_.threshold, points_, rows_.levels(), l,
                                           noisy ? least_share_of_a_ray * of_one_ray : 0.0f)};
        parents_ = std::move(pushed_);
        pushed_.assign(points_.end(l) - points_.begin(l), {});
        const std::vector<Index> last_child = l > 0 ? last_children(l) : std::vector<Index>();
        const Index level_end = points_.end(l);
        const Index batch = std::max(grain, samples_of_a_thread * thread_count() / directions.rays());
        for (Index begin = level.begin, end; begin < level_end; begin = end) {
            for (std::size_t p = 0; p < last_child.size(); ++p) // what no child needs any more
                if (last_child[p] < begin) PushedRow().swap(parents_[p]);
            const Index stop = begin < first_to_do_ ? std::min(first_to_do_, level_end) : level_end;
            end = std::min(begin + batch, stop);
            rays_begun_ += static_cast<double>(end - begin) * directions.rays();
            if (end <= first_to_do_) take_batch(level, begin, end);
            else make_batch(level, begin, end);
        }
    }

    /// Of each receiver of the parents' level, the last of its children among those of a level.
    std::vector<Index> last_children(int l) const {
        const int parent_level = points_.parent_level[l];
        const std::uint32_t first_parent = points_.begin(parent_level);
        std::vector<Index> last(points_.end(parent_level) - first_parent, -1);
        for (Index i = points_.begin(l); i < points_.end(l); ++i)
            for (const std::uint32_t parent : push_.parents.indices(i)) last[parent - first_parent] = i;
        return last;
    }

    /// Receivers whose links are known.
    void take_batch(const Level& level, Index begin, Index end) {
        for_each_receiver(begin, end, [&](RowMaker& maker, Index i) {
            const auto row = resumption_.links.row(i);
            links_[i].assign(row.begin(), row.end());
            if (level.thresholds.has_children)
                maker.push_again(i, level.number, resumption_.links, parents_, level.thresholds.negligible,
                                 pushed_[i - level.begin]);
        });
    }

    void make_batch(const Level& level, Index begin, Index end) {
        const int count = level.directions.rays();
        auto start = Clock::now();
        samples_.resize(static_cast<std::size_t>((end - begin) * count));
        trace_gather(surface_, rows_, points_, begin, level.begin, level.directions,
                     {options_.footprint_angle, points_.spacing[0], rows_.levels()}, samples_);
        statistics_.trace_seconds += seconds_since(start);
        statistics_.rays += samples_.size();
        start = Clock::now();
        require_rows(samples_, rows_);
        statistics_.rows_seconds += seconds_since(start);
        std::vector<std::uint64_t> links_before(static_cast<std::size_t>(end - begin));
        for_each_receiver(begin, end, [&](RowMaker& maker, Index i) {
            const auto r = static_cast<std::size_t>(i - begin);
            maker.make(i, level.number, std::span(samples_).subspan(r * count, count), parents_,
                       level.thresholds, links_[i], pushed_[i - level.begin], links_before[r]);
        });
        for (const std::uint64_t of_receiver : links_before)
            statistics_.links_before += of_receiver;
        if (options_.progress) options_.progress(rays_begun_ / all_rays_);
        if (resumption_.pause) resumption_.pause(static_cast<std::uint32_t>(end), links_);
    }

    void for_each_receiver(Index begin, Index end, const auto& body) {
        const auto start = Clock::now();
        parallel_ranges(end - begin, grain, [&](Index first, Index last) {
            const auto maker = makers_.borrow();
            for (Index i = begin + first; i < begin + last; ++i) body(*maker, i);
        });
        statistics_.links_seconds += seconds_since(start);
    }

    const Surface& surface_;
    const PointHierarchy& points_;
    const PushOperator& push_;
    SenderRows& rows_;
    const LinkOptions& options_;
    LinkStatistics& statistics_;
    const LinkResumption& resumption_;
    const Index first_to_do_;
    ScratchPool<RowMaker> makers_;
    LinkRows links_;
    std::vector<PushedRow> parents_, pushed_; // of the level above, and of the level that is being made
    std::vector<GatherSample> samples_;
    const double all_rays_ = static_cast<double>(rays_of_all(options_, points_));
    double rays_begun_ = 0.0; // those of receivers that were done before included
};

} // namespace

float link_threshold(const LinkOptions& options, const PointHierarchy& points) {
    const double share = std::min(1.0, points.size() / 60'000.0);
    return options.threshold.value_or(
        static_cast<float>(0.06 * options.target_error * share));
}

GatherDirections gather_directions(const LinkOptions& options, const PointHierarchy& points,
                                   int level) {
    return {gather_rays(options, points, level), hash64(options.seed, static_cast<std::uint64_t>(level))};
}

namespace {

/// done_with: is called after each row.
template <class Rows>
Links joined(Rows& rows, const auto& done_with) {
    std::vector<std::uint64_t> begin{0};
    for (const auto& row : rows)
        begin.push_back(begin.back() + row.size());
    std::vector<PackedLink> entry;
    entry.reserve(begin.back());
    for (auto& row : rows) {
        entry.insert(entry.end(), row.begin(), row.end());
        done_with(row);
    }
    return {SharedArray(std::move(begin)), SharedArray(std::move(entry))};
}

} // namespace

Links join_links(const LinkRows& rows) {
    return joined(rows, [](const auto&) {});
}

Links join_links(LinkRows&& rows) {
    return joined(rows, [](std::vector<PackedLink>& row) { std::vector<PackedLink>().swap(row); });
}

LinkRows make_links(const Surface& surface, const PointHierarchy& points, const PushOperator& push,
                    const PullOperator& pull, SenderRows& rows, const LinkOptions& options,
                    LinkStatistics& statistics, const LinkResumption& resumption) {
    return LinkMaker(surface, points, push, pull, rows, options, statistics, resumption).make();
}

} // namespace afterglow
