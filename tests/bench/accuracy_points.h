#pragma once

#include "core/surface.h"
#include "transport/path_tracer.h"

#include <array>
#include <string>
#include <vector>

namespace afterglow {

/// A scene with a viewpoint and the lights under which accuracy is measured.
struct AccuracyScene {
    std::string name; // in the lists of scenes and lights
    std::string path; // for load_scene()
    Vec3 viewpoint = Vec3::Zero();
    std::array<Spotlight, 3> lights; // the scene's own, one at the viewpoint, one elsewhere
};

/// `scenes_file` lists scenes with "file", "view" and "spot"; it may be empty for built-in scenes.
/// `lights_file` adds a third light to each ("other") and describes the built-in ones. All cones
/// have an edge of 5 degrees. Throws FileError.
AccuracyScene find_accuracy_scene(const std::string& name, const std::string& scenes_file,
                                  const std::string& lights_file);

/// The first `count` hits of quasi-random directions from the viewpoint, then as many from the
/// first light. Throws Error where hardly any ray meets a surface.
std::vector<SurfacePoint> visible_points(const Surface& surface, const AccuracyScene& scene,
                                         int count, std::uint64_t seed);

/// Points and their irradiance under the three lights, traced once and then read from a cache.
struct AccuracyReference {
    std::vector<SurfacePoint> points;
    IrradianceEstimate irradiance; // column 3 * point + light
    double seconds = 0.0;          // that tracing it took
    bool from_cache = false;
};

struct ReferenceOptions {
    std::string cache;           // folder
    int points = 1000;           // at each of the two places
    double target_error = 0.015; // relative standard error of each light
    Index max_samples = 1 << 20; // mean paths a point at which tracing gives up
    PathTracerOptions tracer;    // its strategy, batches and progress
    std::uint64_t seed = 1;
};

/// Reads CACHE/NAME-POINTS-HASH.csv or makes it. HASH covers the scene's content, the lights, the
/// number of points and the seed. The file: one line "# " with what it is as JSON, a header, one
/// line a point: x,y,z,nx,ny,nz, then for each light direct, indirect irradiance and the standard
/// error of the indirect, each as r,g,b. A cached reference is used if it is at most as noisy as is
/// asked.
AccuracyReference accuracy_reference(const Surface& surface, const AccuracyScene& scene,
                                     const ReferenceOptions& options);

} // namespace afterglow
