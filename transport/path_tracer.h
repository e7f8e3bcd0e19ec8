#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "core/surface.h"
#include "core/types.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace afterglow {

enum class PathStrategy {
    plain,     // next-event estimation alone: the simplest thing that is right
    connected, // also joins each vertex with the end of a ray from each light: less noise
};

/// "plain", "connected". Throws UsageError for another name.
PathStrategy strategy_from_name(std::string_view name);
std::string strategy_name(PathStrategy strategy);

/// The numbers of samples are explained at EstimatorOptions (mean_estimator.h).
struct PathTracerOptions {
    Index samples = 1024;
    double target_error = 0.0;
    Index max_samples = 1 << 22;
    int batches = 16;
    std::uint64_t seed = 1;
    PathStrategy strategy = PathStrategy::plain;
    std::function<void(double)> progress = {};
};

/// Irradiance [W/m^2] at P points under L lights; column p * L + l belongs to point p and light l.
/// Cosine included, the receiver's own reflectance and 1/pi not.
struct IrradianceEstimate {
    Eigen::Array3Xf direct;              // by one shadow ray, without error
    Eigen::Array3Xf indirect;            // of one bounce and more
    Eigen::Array3Xf standard_error;      // of `indirect`
    std::vector<double> relative_error;  // a light each: sqrt(mean squared standard error) / mean
    std::uint64_t samples = 0, rays = 0; // paths and rays (shadow rays included), all together
};

/// The reference: a path tracer with next-event estimation at each vertex and directions
/// cosine-distributed about the shading normal, so that
///
///     E(x) = mean over paths of sum_k rho_1 ... rho_k E_direct(y_k),
///
/// y_k the vertices that a path from x meets. Paths end by Russian roulette alone, with the
/// survival probability of their largest throughput: unbiased, any number of bounces. All lights
/// are seen from the same paths. What a ray meets counts with the shading normal that
/// Surface::point() turns to the ray's side: normal maps bend no path.
///
/// lights are checked already. Results depend on the seed, not on the number of threads.
IrradianceEstimate estimate_irradiance(const Surface& surface, std::span<const Spotlight> lights,
                                       std::span<const SurfacePoint> points,
                                       const PathTracerOptions& options);

enum class Layer {
    direct,     // radiance towards the camera, rho E_direct / pi
    indirect,   // rho E_indirect / pi
    full,       // both
    irradiance, // E_indirect
};

/// Throws UsageError for an unknown name.
Layer layer_from_name(std::string_view name);
std::string layer_name(Layer layer);

struct PictureEstimate {
    Image image;                 // no attributes; black where the camera sees nothing
    Image variance;              // of each value of `image`, from the spread of the batches
    double relative_error = 0.0; // over the pixels that see something
    std::uint64_t samples = 0, rays = 0;
};

/// Camera rays are jittered over each pixel, a sample each. What they meet shows the irradiance under
/// its Surface::shown_normal m, of the light that arrives from above the surface, whose normal is n:
///
///     E = integral over n . w > 0 of L(w) max(0, m . w) dw.
///
PictureEstimate render_reference(const Surface& surface, const Spotlight& light,
                                 const Camera& camera, Layer layer,
                                 const PathTracerOptions& options);

} // namespace afterglow
