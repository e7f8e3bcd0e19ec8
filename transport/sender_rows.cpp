#include "transport/sender_rows.h"

#include "core/error.h"
#include "core/parallel.h"

namespace afterglow {

SenderRows::SenderRows(const Surface& surface, const ShepardBasis& basis, int levels, float patch_size)
    : surface_(surface), basis_(basis), levels_(levels), grid_(surface.scene(), patch_size),
      place_(static_cast<std::size_t>(grid_.patch_count()) * levels) {}

void SenderRows::require(std::span<const std::uint64_t> numbers) {
    std::vector<std::uint64_t> missing;
    for (const std::uint64_t number : numbers)
        if (place_[number].count == not_made) {
            place_[number].count = 0; // listed once
            missing.push_back(number);
        }
    std::vector<std::vector<BasisEntry>> rows(missing.size());
    parallel_for(static_cast<Index>(missing.size()), [&](Index i) {
        const auto patch = static_cast<std::uint32_t>(missing[i] / levels_);
        const int level = static_cast<int>(missing[i] % levels_);
        const SurfacePoint x = surface_.point(grid_.center(patch));
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
    std::vector<double> sum(points.end(levels_ - 1), 0.0);
    for (std::uint32_t patch = 0; patch < grid_.patch_count(); ++patch) {
        const Place& p = place_[number(patch, levels_ - 1)];
        if (p.count == not_made || p.count == 0) continue;
        const double area = grid_.area(patch);
        for (std::uint32_t e = p.begin; e < p.begin + p.count; ++e)
            sum[entries_[e].index] += area * entries_[e].value;
    }
    // A function whose surroundings no ray met, or one of a coarser level that has no children, gets
    // what its disk would have.
    std::vector<float> areas(sum.size());
    for (int l = 0; l < levels_; ++l)
        for (std::uint32_t i = points.begin(l); i < points.end(l); ++i)
            areas[i] = static_cast<float>(sum[i] > 0.0 ? sum[i] : points.spacing[l] * points.spacing[l]);
    return areas;
}

} // namespace afterglow
