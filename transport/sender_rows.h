#pragma once

#include "basis/shepard_basis.h"
#include "transport/patches.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// How the field of the senders looks from a surface patch: weights of sender *values* (see
/// PushOperator) that sum to one. Made on demand, once a patch, at the patch's centre: two hits in
/// one patch see the same row, which is what makes the gather fast.
class SenderRows {
public:
    /// Senders are the levels [0, sender_levels) of the basis. Keeps references.
    SenderRows(const Surface& surface, const ShepardBasis& basis, int sender_levels, float patch_size);

    const PatchGrid& grid() const { return grid_; }
    /// Makes the rows of these patches (repetitions allowed); not to be called concurrently.
    void require(std::span<const std::uint32_t> patches);
    /// The row of a patch that was required; empty where no function sees it.
    std::span<const BasisEntry> row(std::uint32_t patch) const {
        const Place& p = place_[patch];
        return {entries_.data() + p.begin, p.count};
    }
    std::size_t made() const { return made_; }
    std::size_t uncovered() const { return uncovered_; } // rows that are empty
    std::size_t bytes() const { return entries_.size() * sizeof(BasisEntry) + place_.size() * sizeof(Place); }

private:
    struct Place {
        std::uint32_t begin = 0, count = not_made;
    };
    static constexpr std::uint32_t not_made = ~0u;
    const Surface& surface_;
    const ShepardBasis& basis_;
    int sender_levels_;
    PatchGrid grid_;
    std::vector<Place> place_;
    std::vector<BasisEntry> entries_;
    std::size_t made_ = 0, uncovered_ = 0;
};

} // namespace afterglow
