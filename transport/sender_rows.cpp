#include "transport/sender_rows.h"

#include "core/error.h"
#include "core/parallel.h"

#include <algorithm>

namespace afterglow {

SenderRows::SenderRows(const Surface& surface, const ShepardBasis& basis, int levels, float patch_share)
    : surface_(surface), basis_(basis) {
    std::uint64_t count = 0;
    for (int l = 0; l < levels; ++l) {
        grid_.emplace_back(surface.scene(), patch_share * basis.points().spacing[l]);
        first_.push_back(static_cast<std::uint32_t>(count));
        count += grid_.back().patch_count();
    }
    if (count >= no_index) throw Error("too many surface patches; choose a larger --coarse-radius");
    place_.resize(count);
}

void SenderRows::require(std::span<const std::uint32_t> numbers) {
    std::vector<std::uint32_t> missing;
    for (const std::uint32_t number : numbers)
        if (number != no_index && place_[number].count == not_made) {
            place_[number].count = 0; // listed once
            missing.push_back(number);
        }
    std::vector<std::vector<BasisEntry>> rows(missing.size());
    parallel_for(static_cast<Index>(missing.size()), [&](Index i) {
        const int level = static_cast<int>(
            std::upper_bound(first_.begin(), first_.end(), missing[i]) - first_.begin() - 1);
        const SurfacePoint x = surface_.point(grid_[level].center(missing[i] - first_[level]));
        // Where the level has no function, the next coarser speaks for it.
        for (int l = level; l >= 0 && rows[i].empty(); --l) basis_.evaluate(l, x, rows[i]);
        if (rows[i].empty()) basis_.evaluate_or_nearest(level, x, rows[i]);
    });
    for (std::size_t i = 0; i < missing.size(); ++i) {
        place_[missing[i]] = {static_cast<std::uint32_t>(entries_.size()),
                              static_cast<std::uint32_t>(rows[i].size())};
        entries_.insert(entries_.end(), rows[i].begin(), rows[i].end());
        uncovered_ += rows[i].empty();
    }
    made_ += missing.size();
    if (entries_.size() > 0xf0000000u)
        throw Error("too many sender rows; choose a larger --coarse-radius");
}

std::vector<float> SenderRows::areas() const {
    const PointHierarchy& points = basis_.points();
    const PatchGrid& grid = grid_.back();
    std::vector<double> sum(points.end(levels() - 1), 0.0);
    for (std::uint32_t patch = 0; patch < grid.patch_count(); ++patch) {
        const Place& p = place_[first_.back() + patch];
        if (p.count == not_made || p.count == 0) continue;
        const double area = grid.area(patch);
        for (std::uint32_t e = p.begin; e < p.begin + p.count; ++e)
            sum[entries_[e].index] += area * entries_[e].value;
    }
    // A function whose surroundings no ray met, or one of a coarser level that has no children, gets
    // what its disk would have.
    std::vector<float> areas(sum.size());
    for (int l = 0; l < levels(); ++l)
        for (std::uint32_t i = points.begin(l); i < points.end(l); ++i)
            areas[i] = static_cast<float>(sum[i] > 0.0 ? sum[i] : points.spacing[l] * points.spacing[l]);
    return areas;
}

} // namespace afterglow
