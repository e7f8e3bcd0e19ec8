#pragma once

#include "basis/shepard_basis.h"
#include "transport/patches.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// How the field of the senders looks from a surface patch: for each sender level, weights of sender
/// *values* (see PushOperator) that sum to one. Made on demand, once a patch and level, at the
/// patch's centre: all hits in a patch see the same row, which is what makes the gather fast.
class SenderRows {
public:
    /// Senders are the levels [0, levels) of the basis. Keeps references.
    SenderRows(const Surface& surface, const ShepardBasis& basis, int levels, float patch_size);

    const PatchGrid& grid() const { return grid_; }
    int levels() const { return levels_; }

    /// A patch seen at a level: the row of (patch, level) is number patch * levels() + level.
    std::uint64_t number(std::uint32_t patch, int level) const {
        return static_cast<std::uint64_t>(patch) * levels_ + level;
    }
    /// Makes these rows (repetitions allowed); not to be called concurrently.
    void require(std::span<const std::uint64_t> numbers);
    /// A row that was required; empty where no function sees the patch.
    std::span<const BasisEntry> row(std::uint64_t number) const {
        const Place& p = place_[number];
        return {entries_.data() + p.begin, p.count};
    }
    /// Area that each function of the finest level speaks for, from the patches that were met on
    /// that level; of the level's mean where it was not [world^2]. A number a sender.
    std::vector<float> areas() const;

    std::size_t made() const { return made_; }
    std::size_t uncovered() const { return uncovered_; } // rows that are empty

private:
    struct Place {
        std::uint32_t begin = 0, count = not_made;
    };
    static constexpr std::uint32_t not_made = ~0u;
    const Surface& surface_;
    const ShepardBasis& basis_;
    int levels_;
    PatchGrid grid_;
    std::vector<Place> place_;
    std::vector<BasisEntry> entries_;
    std::size_t made_ = 0, uncovered_ = 0;
};

} // namespace afterglow
