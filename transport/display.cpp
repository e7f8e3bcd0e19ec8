#include "transport/display.h"

namespace afterglow {

Display::Display(const TransferOperator& transfer, const Surface& surface)
    : transfer_(transfer),
      basis_(transfer.points, surface, transfer.kind == OperatorKind::neumann) {}

Rgb Display::irradiance(const SurfacePoint& x, const VectorIrradiance& field, bool& covered) const {
    thread_local std::vector<BasisEntry> row;
    row.clear();
    const int last = transfer_.points.levels() - 1;
    if (transfer_.kind == OperatorKind::neumann)
        basis_.evaluate_or_nearest(last, x, row);
    else
        for (int l = 0; l <= last; ++l)
            basis_.evaluate(l, x, row);
    covered = !row.empty();
    Rgb sum = Rgb::Zero();
    for (const BasisEntry& entry : row) {
        const float* v = &field[9 * static_cast<std::size_t>(entry.index)];
        for (int c = 0; c < 3; ++c)
            sum[c] += entry.value * (x.normal.x() * v[c] + x.normal.y() * v[3 + c] + x.normal.z() * v[6 + c]);
    }
    return sum.max(0.0f);
}

} // namespace afterglow
