#pragma once

#include "basis/nearest_points.h"
#include "basis/point_hierarchy.h"
#include "basis/r_tree.h"
#include "basis/sparse_rows.h"
#include "core/surface.h"

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace afterglow {

using BasisEntry = SparseEntry<float>; // a function and B_j(x)

/// The functions of a hierarchy, to be evaluated anywhere: Shepard-normalised within a level,
///
///     B_j(x) = w_j(x) / sum_k w_k(x),   w_j(x) = K(d_j(x) / r_j) max(0, n . n_j)^p v_j(x)
///                                                            [LZT08, eqs. (2), (8)-(10)],
///
/// where v_j is 1, or 10^-4 where something stands between x and the function's centre (so that
/// light does not leak through thin walls, and a level never loses a point it reaches).
/// One R-tree a level. Immutable; queries may run concurrently.
class ShepardBasis {
public:
    /// Keeps references to both, which must outlive it. `see_walls` false: v_j = 1 always.
    ShepardBasis(const PointHierarchy& points, const Surface& surface, bool see_walls);

    const PointHierarchy& points() const { return points_; }
    /// Appends the functions of one level with B_j(x) > 0, by increasing id; they sum to 1, or there
    /// are none where the level does not cover x.
    void evaluate(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const;
    /// As evaluate; where the level does not cover x, the closest function that faces the same side
    /// and is not behind a wall gets all the weight. Still empty where there is none.
    void evaluate_or_nearest(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const;

private:
    const PointHierarchy& points_;
    const Surface& surface_;
    bool see_walls_;
    std::vector<RTree> tree_;
    std::vector<std::unique_ptr<NearestPoints>> nearest_;

    bool wall_between(const SurfacePoint& x, std::uint32_t j) const;
};

/// Scales the shares of a row so that they sum to one; their sum must not be zero, unless there are
/// none.
void make_sum_one(std::span<BasisEntry> row);

/// Most of the functions that reach a point hardly do: drops shares below a twentieth of a row that
/// sums to one, and scales the others up. Rows that are used often are cut like this, half as long;
/// nothing measurable is lost.
void drop_small_shares(std::vector<BasisEntry>& row);

} // namespace afterglow
