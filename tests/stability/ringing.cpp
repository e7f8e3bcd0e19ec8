#include "tests/stability/ringing.h"

#include "core/parallel.h"
#include "transport/display.h"

#include <algorithm>

namespace afterglow {

Eigen::Array3Xf unclamped_irradiance(const Surface& surface, const TransferOperator& transfer,
                                     const Spotlight& light, std::span<const SurfacePoint> places) {
    const VectorIrradiance field = LightTransport(transfer, surface).indirect(light);
    const Display display(transfer, surface);
    Eigen::Array3Xf irradiance(3, static_cast<Index>(places.size()));
    parallel_for(irradiance.cols(), [&](Index p) {
        bool covered = false;
        irradiance.col(p) =
            display.net_irradiance(places[static_cast<std::size_t>(p)], field, covered);
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
