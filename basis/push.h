#pragma once

#include "basis/shepard_basis.h"
#include "basis/sparse_rows.h"

#include <span>

namespace afterglow {

/// How levels predict each other. A field has a value v_i at every point; a coefficient is what the
/// coarser level did not predict, and *push* adds it up again, level by level:
///
///     v_i = sum_k B_k(x_i) v_k + c_i,   k over the level above i's,  v_i = c_i on the coarsest.
///
/// This is [LZT08, eq. (7)] with one change: each level predicts the next one's values, not every
/// level all finer ones (eq. (6)), so that only one level is ever evaluated at a surface point.
/// `parents` holds B_k(x_i) for every point; a point that nothing above covers has an empty row.
struct PushOperator {
    SparseRows<float> parents;

    /// Sums coefficients to values in place for the points of levels [0, levels).
    /// values: `channels` numbers a point, consecutive.
    void push(const PointHierarchy& points, int levels, int channels, std::span<float> values) const;
    /// The inverse: values to coefficients, in place.
    void difference(const PointHierarchy& points, int levels, int channels,
                    std::span<float> values) const;
};

/// Evaluates the level above at every point. `basis` must be over the same points.
PushOperator make_push_operator(const ShepardBasis& basis);

/// The *pull* of [LZT08, sec. 2.1]: band-limits values before they are differenced, so that each
/// level carries averages. From fine to coarse, over the children c of k on the next finer level,
///
///     v_k = sum_c a_c B_k(x_c) v_c / sum_c a_c B_k(x_c),     a_k = sum_c a_c B_k(x_c),
///
/// where a_c is the area that a function of the finest level speaks for: unlike the unweighted mean
/// it keeps the total, sum_k a_k v_k, from level to level. A function without children keeps its own
/// value.
class PullOperator {
public:
    /// For the levels [0, levels) of the points. area: of each function [world^2]; only those of
    /// functions without children are used.
    PullOperator(const PointHierarchy& points, const PushOperator& push, int levels,
                 std::span<const float> area);
    /// In place; `channels` numbers a point.
    void pull(const PointHierarchy& points, int channels, std::span<float> values) const;

private:
    int levels_;
    SparseRows<float> children_; // normalised rows
};

} // namespace afterglow
