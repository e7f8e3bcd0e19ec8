#pragma once

#include "basis/shepard_basis.h"
#include "basis/sparse_rows.h"

#include <span>

namespace afterglow {

/// How levels predict each other. A field has a value v_i at every point; a coefficient is what the
/// coarser level did not predict, and *push* adds it up again, level by level:
///
///     v_i = sum_k B_k(x_i) v_k + c_i,   k over the parent level of i's,  v_i = c_i on the coarsest.
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
/// level carries averages. From fine to coarse, the field f of the next finer level is averaged with
/// the coarser functions,
///
///     v_k = <B_k, f> / <B_k, 1>,   f = sum_c B_c v_c,
///
/// integrals over the surface. Since the B_k sum to one, sum_k <B_k, 1> v_k = <1, f>: no level has
/// more or less of the light than the next. (The paper's v_k = sum_c B_k(x_c) v_c / sum_c B_k(x_c)
/// loses some, or gains, where functions are unlike in size.)
struct PullOperator {
    /// A row a function of all levels but the finest: its children c on the next finer level with
    /// <B_k, B_c> / <B_k, 1>; those of a thousandth of the row or less are left to the others. A function with an
    /// empty row keeps its own value.
    SparseRows<float> children;

    /// For the levels [0, levels), in place; `channels` numbers a point.
    void pull(const PointHierarchy& points, int levels, int channels, std::span<float> values) const;

    /// The *update* step of the lifting scheme (Sweldens 1998), where push's difference is the
    /// predict step: coefficients, in place, from fine to coarse,
    ///
    ///     c_k += sum_c <B_k, B_c> / <B_k, 1> c_c.
    ///
    /// What finer coefficients still hold in the mean is the coarser level's. A functional
    /// sum_i t_i c_i of the coefficients before is sum_i d_i c_i of those after, where d is t less
    /// the share of the coarser t:  d_c = t_c - sum_k t_k <B_k, B_c> / <B_k, 1>.
    void update(const PointHierarchy& points, int levels, int channels,
                std::span<float> coefficients) const;
};

} // namespace afterglow
