#include "transport/sender_rows.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/accumulator.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

namespace afterglow {
namespace {

/// Multiplies the weights of a row with what the functions' reflectance has in common with that at
/// y; see SenderRows.
void favour_equal_reflectance(const PointHierarchy& points, const Rgb& at_y,
                              std::vector<BasisEntry>& row) {
    constexpr float scale2 = 0.1f * 0.1f, least = 1e-3f;
    for (BasisEntry& entry : row) {
        const Rgb difference = points.reflectance.col(entry.index).array() - at_y;
        entry.value *= least + std::exp(-difference.square().mean() / scale2);
    }
    make_sum_one(row);
}

} // namespace

void sender_row(const Surface& surface, const ShepardBasis& basis, int level, const Hit& hit,
                std::vector<BasisEntry>& row) {
    basis.evaluate_or_nearest(level, surface.point(hit), row);
    favour_equal_reflectance(basis.points(), surface.reflectance(hit), row);
    drop_small_shares(row);
}

SenderRows::SenderRows(const Surface& surface, const ShepardBasis& basis, int levels,
                       float patch_share)
    : surface_(surface), basis_(basis) {
    const PointHierarchy& points = basis.points();
    const Vec3 reach = Vec3::Constant(points.support.maxCoeff());
    const Eigen::AlignedBox3f used(points.position.rowwise().minCoeff() - reach, points.position.rowwise().maxCoeff() + reach);
    std::uint64_t count = 0;
    for (int l = 0; l < levels; ++l) {
        grid_.emplace_back(surface.scene(), patch_share * points.spacing[l], used);
        first_.push_back(static_cast<std::uint32_t>(count));
        count += grid_.back().patch_count();
    }
    if (count >= no_index) throw Error("too many surface patches; choose a larger --coarse-radius");
    place_.resize(count, no_index);
    is_cut_.resize(count);
}

int SenderRows::level_of(std::uint32_t number) const {
    if (number < is_cut_.size())
        return static_cast<int>(std::upper_bound(first_.begin(), first_.end(), number)
                                - first_.begin() - 1);
    return second_rows_[number - is_cut_.size()].level;
}

Hit SenderRows::centre(std::uint32_t number) const {
    if (const auto found = centre_.find(number); found != centre_.end()) return found->second;
    const int level = level_of(number);
    return grid_[level].center(number - first_[level]);
}

bool SenderRows::hidden(const SurfacePoint& x, const SurfacePoint& centre, float relief) const {
    return surface_.blocked(surface_.lifted(x) + relief * x.normal,
                            surface_.lifted(centre) + relief * centre.normal);
}

std::uint32_t SenderRows::side_of(const Hit& hit, std::uint32_t first) const {
    const int level = level_of(first);
    return hidden(surface_.point(hit), surface_.point(centre(first)), grid_[level].relief(first - first_[level]))
               ? second_.at(first)
               : first;
}

void SenderRows::see(std::span<const Hit> arrivals) {
    const auto count = static_cast<Index>(arrivals.size());
    std::vector<std::uint8_t> is_hidden(arrivals.size());
    std::vector<SurfacePoint> place(arrivals.size());
    parallel_for(count, [&](Index k) { place[k] = surface_.point(arrivals[k]); }, 1024);
    std::vector<std::uint64_t> order(arrivals.size()); // patch in the upper half, arrival in the lower
    const auto patch_of = [&](std::size_t n) { return static_cast<std::uint32_t>(order[n] >> 32); };
    const auto arrival_of = [](std::uint64_t key) { return static_cast<std::uint32_t>(key); };
    for (int l = 0; l < levels(); ++l) {
        const PatchGrid& grid = grid_[l];
        parallel_for(count, [&](Index k) {
            order[k] = static_cast<std::uint64_t>(grid.patch_of(arrivals[k])) << 32
                       | static_cast<std::uint64_t>(k);
        }, 1024);
        parallel_sort(order);
        std::vector<std::span<const std::uint64_t>> groups; // arrivals of one patch each
        for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
            while (end < order.size() && patch_of(end) == patch_of(begin)) ++end;
            groups.push_back(std::span(order).subspan(begin, end - begin));
        }
        struct Sides {
            Hit first, second; // where it is not the patch's centre; where there is one
        };
        std::vector<Sides> sides(groups.size());
        parallel_for(static_cast<Index>(groups.size()), [&](Index g) {
            const auto patch = static_cast<std::uint32_t>(groups[g].front() >> 32);
            const float relief = grid.relief(patch);
            Hit centre = grid.center(patch);
            const auto look_from = [&](const Hit& from) {
                centre = from;
                const SurfacePoint eye = surface_.point(centre);
                std::uint32_t seen = 0;
                for (const std::uint64_t key : groups[g])
                    seen += !(is_hidden[arrival_of(key)] = hidden(place[arrival_of(key)], eye, relief));
                return seen;
            };
            if (look_from(centre) == 0)
                look_from(sides[g].first = arrivals[arrival_of(groups[g].front())]);
            for (const std::uint64_t key : groups[g])
                if (is_hidden[arrival_of(key)]) {
                    sides[g].second = arrivals[arrival_of(key)];
                    return;
                }
            // Light may come to a corner though none was counted.
            // The farthest is most likely to lie beyond what hides it, not in it.
            float farthest = 0.0f;
            for (const Hit& corner : grid.corners(patch)) {
                const float d = (surface_.point(corner).position - surface_.point(centre).position)
                                    .squaredNorm();
                if (d <= farthest || !hidden(surface_.point(corner), surface_.point(centre), relief)) continue;
                farthest = d;
                sides[g].second = corner;
            }
        });
        const bool finest = l + 1 == levels();
        std::vector<Arrived> at_second;
        for (std::size_t g = 0; g < groups.size(); ++g) {
            const std::uint32_t first = first_[l] + static_cast<std::uint32_t>(groups[g].front() >> 32);
            const auto at_sides = static_cast<std::uint32_t>(groups[g].size());
            std::uint32_t hidden_from_first = 0;
            for (const std::uint64_t key : groups[g])
                hidden_from_first += is_hidden[arrival_of(key)];
            if (finest && hidden_from_first < at_sides) arrived_.push_back({first, at_sides - hidden_from_first});
            if (sides[g].first) centre_[first] = sides[g].first;
            if (!sides[g].second) continue;
            const auto second = static_cast<std::uint32_t>(place_.size());
            is_cut_[first] = true;
            second_[first] = second;
            second_rows_.push_back({l, static_cast<double>(hidden_from_first) / at_sides});
            centre_[second] = sides[g].second;
            place_.push_back(no_index);
            if (finest && hidden_from_first > 0) at_second.push_back({second, hidden_from_first});
        }
        arrived_.insert(arrived_.end(), at_second.begin(), at_second.end());
    }
}

void SenderRows::require(std::span<const std::uint32_t> numbers) {
    std::vector<std::uint32_t> missing;
    for (const std::uint32_t number : numbers)
        if (number != no_index && !is_made(number)) {
            place_[number] = static_cast<std::uint32_t>(made() + missing.size()); // listed once
            missing.push_back(number);
        }
    std::vector<std::vector<BasisEntry>> rows(missing.size());
    parallel_for(static_cast<Index>(missing.size()), [&](Index i) {
        const int level = level_of(missing[i]);
        const Hit center = centre(missing[i]);
        const SurfacePoint x = surface_.point(center);
        if (level + 1 == levels())
            sender_row(surface_, basis_, level, center, rows[i]);
        else
            basis_.evaluate_or_nearest(level, x, rows[i]);
        // Into a gap that no fine function lies in, coarse ones must not shine.
        if (basis_.enclosed(levels() - 1, x)) {
            std::vector<BasisEntry> finest;
            basis_.evaluate(levels() - 1, x, finest);
            if (finest.empty()) rows[i].clear();
        }
        // Where the level has no function, the next coarser speaks for it.
        else if (rows[i].empty())
            for (int l = level - 1; l >= 0 && rows[i].empty(); --l)
                basis_.evaluate(l, x, rows[i]);
        drop_small_shares(rows[i]);
    });
    for (const std::vector<BasisEntry>& row : rows) {
        entries_.insert(entries_.end(), row.begin(), row.end());
        begin_.push_back(static_cast<std::uint32_t>(entries_.size()));
        uncovered_ += row.empty();
    }
    if (entries_.size() > 0xf0000000u)
        throw Error("too many sender rows; choose a larger --coarse-radius");
}

PullOperator SenderRows::make_pull_operator() {
    const PointHierarchy& points = basis_.points();
    const std::vector<Arrived> arrived = std::exchange(arrived_, {});
    std::vector<std::uint32_t> patches; // rows of the finest level in which rays were counted
    for (const Arrived& a : arrived)
        patches.push_back(a.number);
    const auto count = static_cast<Index>(patches.size());
    std::vector<std::vector<std::uint32_t>> seen(levels()); // number of each patch's row on a level
    for (int l = 0; l + 1 < levels(); ++l) {
        seen[l].resize(patches.size());
        parallel_for(count, [&](Index p) { seen[l][p] = number(centre(patches[p]), l); });
        require(seen[l]);
    }
    seen.back() = patches;
    require(patches);

    std::vector<std::vector<BasisEntry>> rows(points.end(levels() - 1));
    for (int l = 0; l + 1 < levels(); ++l) {
        // Turned around: the patches in which each function of the level is seen.
        std::vector<std::uint32_t> begin(points.end(l) - points.begin(l) + 2, 0);
        for (const std::uint32_t patch_row : seen[l])
            for (const BasisEntry& entry : row(patch_row))
                if (entry.index >= points.begin(l)) ++begin[entry.index - points.begin(l) + 2];
        std::partial_sum(begin.begin(), begin.end(), begin.begin());
        std::vector<std::pair<std::uint32_t, float>> sees(begin.back());
        for (std::uint32_t p = 0; p < patches.size(); ++p)
            for (const BasisEntry& entry : row(seen[l][p]))
                if (entry.index >= points.begin(l))
                    sees[begin[entry.index - points.begin(l) + 1]++] =
                        {p, static_cast<float>(arrived[p].rays) * entry.value};
        ScratchPool<Accumulator<double>> sums(
            [&] { return std::make_unique<Accumulator<double>>(points.end(l + 1), 0.0); });
        parallel_ranges(points.end(l) - points.begin(l), 64, [&](Index first, Index last) {
            const auto sum = sums.borrow();
            for (Index k = first; k < last; ++k) {
                double total = 0.0, kept = 0.0;
                for (const auto& [p, weight] : std::span(sees).subspan(begin[k], begin[k + 1] - begin[k]))
                    for (const BasisEntry& child : row(seen[l + 1][p]))
                        if (child.index >= points.begin(l + 1)) {
                            const double share = static_cast<double>(weight) * child.value;
                            sum->at(child.index) += share;
                            total += share;
                        }
                std::vector<BasisEntry>& children = rows[points.begin(l) + k];
                sum->for_each(0, points.end(l + 1), [&](std::uint32_t child, double share) {
                    if (share <= 1e-3 * total) return;
                    children.push_back({child, static_cast<float>(share)});
                    kept += share;
                });
                for (BasisEntry& child : children)
                    child.value = static_cast<float>(child.value / kept);
                sum->clear();
            }
        });
    }
    rows.resize(points.begin(levels() - 1));
    return {join_rows(std::move(rows))};
}

std::vector<std::uint32_t> SenderRows::made_numbers() const {
    std::vector<std::uint32_t> numbers;
    for (std::uint32_t n = 0; n < place_.size(); ++n)
        if (is_made(n)) numbers.push_back(n);
    return numbers;
}

std::vector<float> SenderRows::finest_areas() const {
    const int finest = levels() - 1;
    const PatchGrid& grid = grid_.back();
    const std::uint32_t begin = basis_.points().begin(finest);
    std::vector<double> area(basis_.points().end(finest) - begin, 0.0);
    const auto add = [&](std::uint32_t number, double of_row) {
        if (!is_made(number)) return;
        for (const BasisEntry& entry : row(number))
            if (entry.index >= begin) area[entry.index - begin] += of_row * entry.value;
    };
    for (std::uint32_t patch = 0; patch < grid.patch_count(); ++patch) {
        const std::uint32_t number = first_[finest] + patch;
        if (!is_cut_[number]) {
            add(number, grid.area(patch));
            continue;
        }
        const std::uint32_t second = second_.at(number);
        const double share = second_rows_[second - is_cut_.size()].share;
        add(number, (1.0 - share) * grid.area(patch));
        add(second, share * grid.area(patch));
    }
    std::vector<float> areas(area.begin(), area.end());
    const float spacing = basis_.points().spacing[finest];
    parallel_for(static_cast<Index>(areas.size()), [&](Index k) {
        constexpr float small = 0.2f, least_share = 0.5f;
        if (areas[k] > small * spacing * spacing) return;
        const std::uint32_t point = begin + static_cast<std::uint32_t>(k);
        if (areas[k] == 0.0f ? is_seen(point) : areas[k] < least_share * area_around(point)) areas[k] = in_few_rows;
    }, 16);
    return areas;
}

bool SenderRows::is_seen(std::uint32_t point) const {
    const SurfacePoint x = basis_.points().point(point);
    const Hit own = surface_.closest_hit({surface_.lifted(x), -x.normal, 4.0f * surface_.lift()});
    return own && is_made(number(own, levels() - 1));
}

float SenderRows::area_around(std::uint32_t point) const {
    constexpr int count = 32;
    constexpr float depth = 0.25f, least_cosine = 0.2f;
    const int finest = levels() - 1;
    const SurfacePoint x = basis_.points().point(point);
    const float radius = basis_.points().support[point];
    const Frame frame(x.normal);
    const Vec3 above = surface_.lifted(x);
    std::vector<BasisEntry> row;
    double sum = 0.0;
    for (int k = 0; k < count; ++k) {
        const Vec2 at = radius * spiral_point(static_cast<float>(k), count);
        const Vec3 from = above + frame.to_world({at.x(), at.y(), 0.0f});
        const Hit hit = surface_.closest_hit({from, -x.normal, depth * radius});
        if (!hit || !is_made(number(hit, finest))) continue;
        row.clear();
        sender_row(surface_, basis_, finest, hit, row);
        for (const BasisEntry& entry : row)
            if (entry.index == point) sum += entry.value / std::max(least_cosine, hit.cosine);
    }
    return static_cast<float>(EIGEN_PI * radius * radius / count * sum);
}

} // namespace afterglow
