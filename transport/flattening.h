#pragma once

#include "basis/shepard_basis.h"
#include "transport/transfer_operator.h"

#include <vector>

namespace afterglow {

/// The paper's operator gives coefficients on every level, of a field that is the sum of all levels
/// [LZT08, eq. (6)]. Flattened [LZT08, sec. 4.1], the last level's entries hold the field's values at
/// its points, so that this level alone is read. What the coarser levels do between these points is
/// lost.
class Flattening {
public:
    /// Evaluates all levels at the points of the last one.
    Flattening(const PointHierarchy& points, const Surface& surface);
    /// In place.
    void apply(VectorIrradiance& field) const;

private:
    std::uint32_t first_;
    SparseRows<float> rows_; // a row a point of the last level
};

} // namespace afterglow
