#pragma once

#include "transport/display.h"
#include "transport/path_tracer.h"
#include "transport/precompute.h"

#include <span>
#include <vector>

namespace afterglow {

/// A scene and its operator; default settings unless others are given.
class Precomputed {
public:
    explicit Precomputed(Scene scene, const PrecomputeOptions& options = {});
    Precomputed(const Precomputed&) = delete; // the members refer to each other
    Precomputed& operator=(const Precomputed&) = delete;

    const Scene& scene() const { return scene_; }
    const Surface& surface() const { return surface_; }
    const TransferOperator& transfer() const { return transfer_; }
    const LightTransport& transport() const { return transport_; }
    const Display& display() const { return display_; }
    /// R of the coarsest level [m].
    double coarse_radius() const { return transfer_.points.spacing[0]; }

    /// Indirect irradiance under a light as a query answers it, 3 x places [W/m^2].
    Eigen::Array3Xf indirect(const Spotlight& light, std::span<const SurfacePoint> places) const;

private:
    Scene scene_;
    Surface surface_;
    TransferOperator transfer_;
    LightTransport transport_;
    Display display_;
};

/// The operator's indirect irradiance at some places and the path tracer's.
struct Comparison {
    Eigen::Array3Xf indirect, reference; // 3 x places [W/m^2]
    Eigen::Array3Xf standard_error;      // of the reference

    /// Of the places [first, first + count).
    Comparison part(Index first, Index count) const;

    double reference_mean() const { return reference.cast<double>().mean(); }
    /// Root mean square error relative to a mean irradiance, the reference's variance subtracted; 0
    /// where that leaves nothing.
    double rel_rmse(double mean) const;
    double rel_rmse() const { return rel_rmse(reference_mean()); }
    /// Mean error relative to the reference's mean.
    double bias() const { return indirect.cast<double>().mean() / reference_mean() - 1.0; }
    /// Its standard error by the reference's noise.
    double bias_error() const;
    /// Root mean square of the standard errors relative to the reference's mean.
    double reference_error() const;
};

/// target_error: of the reference, relative; tracing gives up at a mean of 2^13 paths a place,
/// which is told by reference_error().
Comparison compare(const Precomputed& precomputed, const Spotlight& light,
                   std::span<const SurfacePoint> places, double target_error = 0.02);

} // namespace afterglow
