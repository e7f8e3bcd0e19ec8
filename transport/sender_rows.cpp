#include "transport/sender_rows.h"

#include "core/error.h"
#include "core/parallel.h"

namespace afterglow {

SenderRows::SenderRows(const Surface& surface, const ShepardBasis& basis, int sender_levels,
                       float patch_size)
    : surface_(surface), basis_(basis), sender_levels_(sender_levels),
      grid_(surface.scene(), patch_size), place_(grid_.patch_count()) {}

void SenderRows::require(std::span<const std::uint32_t> patches) {
    std::vector<std::uint32_t> missing;
    for (const std::uint32_t p : patches)
        if (place_[p].count == not_made) {
            place_[p].count = 0; // listed once
            missing.push_back(p);
        }
    std::vector<std::vector<BasisEntry>> rows(missing.size());
    parallel_for(static_cast<Index>(missing.size()), [&](Index i) {
        const SurfacePoint x = surface_.point(grid_.center(missing[i]));
        // The finest level speaks for the patch; where it has no function, the next coarser does.
        for (int l = sender_levels_ - 1; l >= 0 && rows[i].empty(); --l)
            basis_.evaluate(l, x, rows[i]);
        if (rows[i].empty()) basis_.evaluate_or_nearest(sender_levels_ - 1, x, rows[i]);
    });
    for (std::size_t i = 0; i < missing.size(); ++i) {
        place_[missing[i]] = {static_cast<std::uint32_t>(entries_.size()),
                              static_cast<std::uint32_t>(rows[i].size())};
        entries_.insert(entries_.end(), rows[i].begin(), rows[i].end());
        uncovered_ += rows[i].empty();
    }
    made_ += missing.size();
    if (entries_.size() > 0xf0000000u) throw Error("too many sender rows; choose a larger --coarse-radius");
}

} // namespace afterglow
