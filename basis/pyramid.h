#pragma once

#include "basis/push.h"
#include "basis/shepard_basis.h"
#include "basis/sparse_rows.h"

#include <span>

namespace afterglow {

/// Analysis as printed [LZT08, eq. (7)]: a coefficient is what *all* coarser levels together do not
/// say of a point's value,
///
///     alpha_i = f_i - sum_k B_k(x_i) alpha_k,   k over the levels above i's,
///
/// so that sum_k B_k(x) alpha_k over all levels is the field at any x (eq. (6)). A level without a
/// function at x_i contributes nothing there. PushOperator is what we use instead.
struct Pyramid {
    SparseRows<float> coarser; // a row a point: B_k(x_i), k over all levels above, rising

    /// Values to coefficients, in place, for the points of levels [0, levels); `channels` numbers a
    /// point.
    void analyse(const PointHierarchy& points, int levels, int channels,
                 std::span<float> values) const;
};

/// For the points of levels [0, levels). `basis` must be over the same points.
Pyramid make_pyramid(const ShepardBasis& basis, int levels);

/// The pull as printed [LZT08, sec. 2.1]: a function's value becomes the mean of its children's,
/// weighted with B_k(x_c).
PullOperator make_point_pull(const ShepardBasis& basis, int levels);

} // namespace afterglow
