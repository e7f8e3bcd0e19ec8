#include "tests/stability/comparison.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace afterglow {

Precomputed::Precomputed(Scene scene, const PrecomputeOptions& options)
    : scene_(std::move(scene)), surface_(scene_), transfer_(precompute(surface_, options)),
      transport_(transfer_, surface_), display_(transfer_, surface_) {}

Eigen::Array3Xf Precomputed::indirect(const Spotlight& light,
                                      std::span<const SurfacePoint> places) const {
    return display_.irradiance(places, transport_.indirect(light), light);
}

Comparison Comparison::part(Index first, Index count) const {
    return {indirect.middleCols(first, count), reference.middleCols(first, count),
            standard_error.middleCols(first, count)};
}

double Comparison::rel_rmse(double mean) const {
    const double square = (indirect - reference).cast<double>().square().mean()
                          - standard_error.cast<double>().square().mean();
    return std::sqrt(std::max(0.0, square)) / mean;
}

double Comparison::bias_error() const {
    return reference_error() / std::sqrt(static_cast<double>(reference.cols()));
}

double Comparison::reference_error() const {
    return std::sqrt(standard_error.cast<double>().square().mean()) / reference_mean();
}

Comparison compare(const Precomputed& precomputed, const Spotlight& light,
                   std::span<const SurfacePoint> places, double target_error) {
    PathTracerOptions options;
    options.target_error = target_error;
    options.max_samples = 1 << 13;
    options.seed = 17;
    options.strategy = PathStrategy::connected;
    IrradianceEstimate reference =
        estimate_irradiance(precomputed.surface(), {&light, 1}, places, options);
    return {precomputed.indirect(light, places), std::move(reference.indirect),
            std::move(reference.standard_error)};
}

} // namespace afterglow
