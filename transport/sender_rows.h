#pragma once

#include "basis/push.h"
#include "basis/shepard_basis.h"
#include "transport/patches.h"

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

namespace afterglow {

/// How the field of the senders looks from a surface patch: for each sender level, weights of sender
/// *values* (see PushOperator) that sum to one. Made on demand, once a patch and level, at the
/// patch's centre: all hits in a patch see the same row, which is what makes the gather fast.
///
/// What stands on a surface cuts its patches: a wall may leave a part on either side, a chair leg
/// cover the centre. So a patch has a second row where some of the light that arrives comes from
/// places that do not see the first's, and none of its rows is made where no light comes from.
///
/// On the finest level a weight B_j(y) is multiplied with
///
///     10^-3 + exp(-|rho(y) - rho_j|^2 / (3 0.1^2)),
///
/// before the row is made to sum to one: radiosity jumps where reflectance does. (Coarser levels
/// carry means over all that lies below them.)
class SenderRows {
public:
    /// Senders are the levels [0, levels) of the basis; the patches of a level are at most
    /// `patch_share` times its spacing long. Keeps references.
    SenderRows(const Surface& surface, const ShepardBasis& basis, int levels, float patch_share = 0.5f);

    int levels() const { return static_cast<int>(grid_.size()); }
    /// The row with which a level sees the patch of a hit.
    std::uint32_t number(const Hit& hit, int level) const {
        const std::uint32_t n = first_[level] + grid_[level].patch_of(hit);
        return is_cut_[n] ? side_of(hit, n) : n;
    }
    bool is_made(std::uint32_t number) const { return place_[number] != no_index; }
    /// Makes these rows (repetitions allowed, no_index is passed over); not to be called concurrently.
    void require(std::span<const std::uint32_t> numbers);
    /// Where a row that was required stands among all that were: these are fewer than the numbers.
    std::uint32_t place(std::uint32_t number) const { return place_[number]; }
    /// The row there; empty where no function sees the patch.
    std::span<const BasisEntry> at(std::uint32_t place) const {
        return {entries_.data() + begin_[place], begin_[place + 1] - begin_[place]};
    }
    std::span<const BasisEntry> row(std::uint32_t number) const { return at(place_[number]); }
    /// Asks for where a row begins, or for its entries, ahead of use.
    void prefetch_begin(std::uint32_t place) const { __builtin_prefetch(&begin_[place]); }
    void prefetch_row(std::uint32_t place) const {
        __builtin_prefetch(entries_.data() + begin_[place]);
        __builtin_prefetch(entries_.data() + begin_[place] + 8);
    }
    /// Finds the patches that are cut, and counts the rays that end in each; to be called once, before
    /// all else, with rays such as the gather's.
    void see(std::span<const Hit> arrivals);
    /// The pull between the levels. Its integrals run over the patches of the finest level, each
    /// weighted with the rays that were counted there: it is the light that arrives at the receivers
    /// which is the same on every level, not the light that leaves, of which some is never seen.
    /// To be called once: what was counted is forgotten, for it takes memory.
    PullOperator make_pull_operator();
    /// <B_j, 1> of the finest level's functions [world^2], over the patches of which rows were made:
    /// those that are seen. `in_few_rows` of a function on an edge, of which patches' centres see less than
    /// half of what there is around its point: that small area would glare under all the light that falls there.
    std::vector<float> finest_areas() const;
    static constexpr float in_few_rows = -1.0f;

    std::size_t made() const { return begin_.size() - 1; }
    std::vector<std::uint32_t> made_numbers() const; // rising
    std::uint32_t count() const { return static_cast<std::uint32_t>(place_.size()); } // of all, made or not
    std::size_t uncovered() const { return uncovered_; } // rows that are empty

private:
    struct Arrived {
        std::uint32_t number, rays;
    };
    const Surface& surface_;
    const ShepardBasis& basis_;
    std::vector<PatchGrid> grid_;       // a level each
    std::vector<std::uint32_t> first_;  // of a level's rows; after the last level's, the second rows
    std::vector<std::uint32_t> place_;  // no_index: not made
    std::vector<bool> is_cut_;                                      // a first row each
    std::unordered_map<std::uint32_t, std::uint32_t> second_;       // rows of patches that are cut
    struct Second {
        int level;
        double share; // of the rays counted at the patch
    };
    std::vector<Second> second_rows_; // numbers above all first ones, rising
    std::unordered_map<std::uint32_t, Hit> centre_;                 // where it is not the patch's own
    std::vector<Arrived> arrived_; // rays counted, of the finest level's rows that any arrive at, numbers rising
    std::vector<std::uint32_t> begin_{0}; // of a place's entries, and the end of all
    std::vector<BasisEntry> entries_;
    std::size_t uncovered_ = 0;

    int level_of(std::uint32_t number) const;
    Hit centre(std::uint32_t number) const;
    bool hidden(const SurfacePoint& x, const SurfacePoint& centre, float relief) const;
    std::uint32_t side_of(const Hit& hit, std::uint32_t first) const;
    /// Whether a row of the patch that a finest point lies on was made.
    bool is_seen(std::uint32_t point) const;
    /// <B_j, 1> of a finest function from places on its support, where patches are seen: to about a third.
    float area_around(std::uint32_t point) const;
};

/// Appends the row of a finest level at any hit, not at a patch's centre; none where evaluate_or_nearest
/// finds none.
void sender_row(const Surface& surface, const ShepardBasis& basis, int level, const Hit& hit,
                std::vector<BasisEntry>& row);

} // namespace afterglow
