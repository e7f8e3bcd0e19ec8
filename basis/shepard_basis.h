#pragma once

#include "basis/nearest_points.h"
#include "basis/point_hierarchy.h"
#include "basis/r_tree.h"
#include "basis/sparse_rows.h"
#include "core/surface.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace afterglow {

using BasisEntry = SparseEntry<float>; // a function and B_j(x)

/// The functions of a hierarchy, to be evaluated anywhere: Shepard-normalised within a level,
///
///     B_j(x) = w_j(x) / sum_k w_k(x),   w_j(x) = K(d_j(x) / r_j) max(0, n . n_j)^p o_j(x) v_j(x)
///                                                            [LZT08, eqs. (2), (8)-(10)].
///
/// o_j: on levels placed by openness, 10^-3 + openness_likeness() of x and the function's centre: in
/// a contact only what is in the contact too counts. x is probed where the functions that reach it
/// differ among themselves, or something lies within R / 2 above it; else o_j = 1.
///
/// v_j: 1, or 0 where something stands between x and the function's centre, so that light does not
/// leak through walls however thin. Where functions in sight have less than a hundredth of the
/// weight of those behind walls, 10^-4 instead of 0, so that a level never loses a point it reaches;
/// but a point that is enclosed, as under a carpet, and sees no function is not covered.
/// Weights below a thousandth of those in sight are left out.
/// One R-tree a level. Immutable; queries may run concurrently.
class ShepardBasis {
public:
    /// Keeps references to both, which must outlive it. `see_walls` false: v_j = 1 always.
    /// `only_level`: no other will be evaluated.
    ShepardBasis(const PointHierarchy& points, const Surface& surface, bool see_walls,
                 std::optional<int> only_level = {});

    const PointHierarchy& points() const { return points_; }
    /// Appends the functions of one level with B_j(x) > 0, by increasing id; they sum to 1, or there
    /// are none where the level does not cover x.
    void evaluate(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const;
    /// Whether is_enclosed() holds at x; false on levels without openness.
    bool enclosed(int level, const SurfacePoint& x) const;
    /// Whether something lies within so many spacings above x.
    bool roofed(int level, const SurfacePoint& x, float spacings = 2.0f) const;
    /// Of the functions within four spacings that face the same side as x, the closest that is not
    /// behind a wall, with the share 1; none where there is none.
    bool closest_in_sight(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const;
    /// Whether x lies in a gap that functions cannot resolve: something stands within two spacings above
    /// it, and far_openness() < 0.5; false on levels without openness.
    bool in_gap(int level, const SurfacePoint& x) const;
    /// As evaluate; where the level does not cover x, or not with functions in sight, the closest
    /// function within four times its spacing that faces the same side and is not behind a wall gets
    /// all the weight, if there is one; none where x is enclosed.
    void evaluate_or_nearest(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const;
    /// What is costly in a row, for use at all places close to x: appends o_j(x) v_j(x), up to a
    /// factor that they share, of the functions that have a weight anywhere within `reach` of x
    /// [world], by increasing id.
    void factors(int level, const SurfacePoint& x, float reach, std::vector<BasisEntry>& found) const;
    /// Appends the row of evaluate_or_nearest at y, as far as factors that were found close to it tell:
    /// K(d_j(y) / r_j) max(0, n_y . n_j)^p times these, scaled to sum to one. Where all are zero, the
    /// closest of the functions has it all.
    void apply_factors(std::span<const BasisEntry> factors, const SurfacePoint& y,
                       std::vector<BasisEntry>& row) const;

private:
    /// K(d / r_j) max(0, n . n_j)^p alone: the weight without o_j and v_j; d is d_j(x), less `reach`.
    float weight(const SurfacePoint& x, std::uint32_t j, float reach) const;

    const PointHierarchy& points_;
    const Surface& surface_;
    bool see_walls_;
    struct Level {
        RTree tree;
        std::unique_ptr<NearestPoints> nearest;
        std::optional<OpennessProbe> probe; // from PointHierarchy::openness_level on
        std::vector<float> lift;            // of each function's centre [world], where walls are seen
        float highest_lift = 0.0f;
    };
    std::vector<std::optional<Level>> level_;

    void prepare(int level);
    /// Weights w_j(x) o_j(x) v_j(x), not yet scaled, by increasing id, of functions within `reach`;
    /// whether there are some and functions in sight decide.
    bool append(int level, const SurfacePoint& x, float reach, std::vector<BasisEntry>& row) const;
    /// Puts the closest function in sight, if there is one, in the stead of the entries from `first`
    /// on; whether it did.
    bool take_nearest(int level, const SurfacePoint& x, std::size_t first,
                      std::vector<BasisEntry>& row) const;
    /// Weights, not yet scaled to sum to one, times the openness term.
    bool favour_equal_openness(int level, const SurfacePoint& x, std::span<BasisEntry> row) const;
    /// Weights times v_j. Sorts the row, largest first, and leaves what is kept at its begin.
    /// `enough`: whether functions in sight decide.
    std::size_t hide_behind_walls(int level, const SurfacePoint& x, std::span<BasisEntry> row,
                                  bool& enough) const;
    /// How high over x to look for walls: `wanted`, or half way to what is closer above it.
    float free_lift(const SurfacePoint& x, float wanted) const;
    bool wall_between(int level, const SurfacePoint& x, float lift_of_x, std::uint32_t j) const;
};

/// Scales the shares of a row so that they sum to one; their sum must not be zero, unless there are
/// none.
void make_sum_one(std::span<BasisEntry> row);

/// Most of the functions that reach a point hardly do: drops shares below a twentieth of a row that
/// sums to one, and scales the others up. Rows that are used often are cut like this, half as long;
/// nothing measurable is lost.
void drop_small_shares(std::vector<BasisEntry>& row);

} // namespace afterglow
