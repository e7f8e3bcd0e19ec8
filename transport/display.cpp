#include "transport/display.h"

#include "core/parallel.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

namespace afterglow {

Display::Display(const TransferOperator& transfer, const Surface& surface)
    : transfer_(transfer),
      basis_(transfer.points, surface, transfer.kind == OperatorKind::neumann,
             transfer.kind == OperatorKind::neumann ? std::optional(transfer.points.levels() - 1)
                                                    : std::nullopt) {}

Rgb Display::net_irradiance(const SurfacePoint& x, const Vec3& normal,
                            const VectorIrradiance& field, bool& covered) const {
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
            sum[c] += entry.value * (normal.x() * v[c] + normal.y() * v[3 + c] + normal.z() * v[6 + c]);
    }
    return sum;
}

Eigen::Array3Xf Display::irradiance(std::span<const SurfacePoint> places,
                                    const VectorIrradiance& field, Index* uncovered) const {
    Eigen::Array3Xf result(3, static_cast<Index>(places.size()));
    std::vector<std::uint8_t> is_uncovered(places.size());
    parallel_for(result.cols(), [&](Index p) {
        const auto i = static_cast<std::size_t>(p);
        bool covered = false;
        result.col(p) = irradiance(places[i], field, covered);
        is_uncovered[i] = !covered;
    });
    if (uncovered) *uncovered = std::count(is_uncovered.begin(), is_uncovered.end(), 1);
    return result;
}

} // namespace afterglow
