#include "tests/stability/seeds.h"

#include "transport/display.h"

#include <cassert>
#include <cmath>
#include <span>

namespace afterglow {
namespace {

Eigen::Array3Xd mean_over(std::span<const Eigen::Array3Xf> results) {
    Eigen::Array3Xd sum = Eigen::Array3Xd::Zero(3, results.front().cols());
    for (const Eigen::Array3Xf& e : results)
        sum += e.cast<double>();
    return sum / static_cast<double>(results.size());
}

} // namespace

OfSeeds indirect_of_seeds(const Setting& setting, std::uint64_t first, int count,
                          PrecomputeOptions options) {
    const Surface surface(setting.scene);
    OfSeeds results;
    for (int k = 0; k < count; ++k) {
        options.seed = first + static_cast<std::uint64_t>(k);
        const TransferOperator transfer = precompute(surface, options);
        const LightTransport transport(transfer, surface);
        const Display display(transfer, surface);
        const auto places = static_cast<Index>(setting.places.size());
        const auto lights = static_cast<Index>(setting.lights.size());
        Eigen::Array3Xf e(3, lights * places);
        for (Index l = 0; l < lights; ++l) {
            const VectorIrradiance field = transport.indirect(setting.lights[l]);
            e.middleCols(l * places, places) = display.irradiance(setting.places, field, setting.lights[l]);
        }
        results.push_back(std::move(e));
    }
    return results;
}

Difference difference(const OfSeeds& base, const OfSeeds& other) {
    assert(base.size() >= 2 && !other.empty() && other.size() <= base.size());
    const Eigen::Array3Xd mean = mean_over(base);
    double variance = 0.0; // of one seed's result, mean over lights, places and colours
    for (const Eigen::Array3Xf& e : base)
        variance += (e.cast<double>() - mean).square().mean();
    variance /= static_cast<double>(base.size()) - 1.0;

    const Eigen::Array3Xd off = mean_over(other) - mean_over(std::span(base).first(other.size()));
    const double unit = mean.mean();
    return {std::sqrt(off.square().mean()) / unit,
            std::sqrt(2.0 * variance / static_cast<double>(other.size())) / unit,
            off.mean() / unit};
}

} // namespace afterglow
