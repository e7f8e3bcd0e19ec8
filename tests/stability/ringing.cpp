#include "tests/stability/ringing.h"

#include "basis/shepard_basis.h"
#include "core/parallel.h"

#include <algorithm>
#include <cassert>

namespace afterglow {

Eigen::Array3Xf unclamped_irradiance(const Surface& surface, const TransferOperator& transfer,
                                     const Spotlight& light, std::span<const SurfacePoint> places) {
    assert(transfer.kind == OperatorKind::neumann);
    const VectorIrradiance field = LightTransport(transfer).indirect(surface, light);
    const ShepardBasis basis(transfer.points, surface, true);
    const int last = transfer.points.levels() - 1;
    Eigen::Array3Xf irradiance = Eigen::Array3Xf::Zero(3, static_cast<Index>(places.size()));
    parallel_for(irradiance.cols(), [&](Index p) {
        std::vector<BasisEntry> row;
        const SurfacePoint& x = places[static_cast<std::size_t>(p)];
        basis.evaluate_or_nearest(last, x, row);
        for (const BasisEntry& entry : row) {
            const float* v = &field[9 * static_cast<std::size_t>(entry.index)];
            for (int axis = 0; axis < 3; ++axis)
                irradiance.col(p) += entry.value * x.normal[axis] * Rgb::Map(v + 3 * axis);
        }
    });
    return irradiance;
}

Ringing ringing_of(const Eigen::Array3Xf& unclamped) {
    const Eigen::ArrayXf least = unclamped.colwise().minCoeff().transpose();
    const double mean = unclamped.max(0.0f).cast<double>().mean();
    const auto depth = std::max(0.0, -static_cast<double>(least.minCoeff()));
    return {static_cast<double>((least < 0.0f).count()) / static_cast<double>(least.size()),
            depth > 0.0 ? depth / mean : 0.0};
}

} // namespace afterglow
