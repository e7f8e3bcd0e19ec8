#pragma once

#include "core/surface.h"
#include "transport/error_parts.h"
#include "transport/precompute.h"
#include "transport/verification.h"

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace afterglow {

/// Of the trials that all points of a scene share: so many times three lights, with places of their own.
inline constexpr int chart_trials = 4, chart_lights = 3 * chart_trials, chart_places = 1000;

/// One way to precompute a scene (or to trace its paths), and what came of it: a point of a chart.
struct ChartPoint {
    std::string sweep;  // as in chart_settings()
    double value = 0.0; // of what the sweep varies
    double seconds = 0.0;        // that it took, without loading the scene and without this measurement
    double update_seconds = 0.0; // of light: direct, all bounces, display level
    std::uint64_t bytes = 0;     // of the transfer file
    std::uint64_t functions = 0, links = 0, rays = 0;
    float coarse_radius = 0.0f; // R_0 [world]
    double points_seconds = 0.0, push_seconds = 0.0, pull_seconds = 0.0, gather_seconds = 0.0,
           rows_seconds = 0.0, links_seconds = 0.0, series_seconds = 0.0, tuning_seconds = 0.0;
    VerifiedError error; // under lights and at places that all points of a scene share
    ErrorParts parts;    // of the sweep "spacing"
};

struct ChartSetting {
    std::string sweep;
    double value = 0.0;
    PrecomputeOptions options;
    std::optional<double> target = {}; // of precompute_to_target()
    double most_seconds = std::numeric_limits<double>::infinity(); // of that search
    /// coarse_radius of the options is this share of the radius that is found by itself; 0: left to it.
    float radius_share = 0.0f;
    Index path_samples = 0; // above 0: paths a place instead of an operator
};

/// What a chart consists of, in order of their time:
///
///     spacing   value = coarse_scale: the spacing by hand
///     target    value = target error: the spacing by precompute_to_target()
///     path      value = paths a place: the path tracer, with connections; its seconds are those of a
///               picture of 1280 x 720 pixels under one light, at best
///     paper     value = epsilon pi, as printed: the operator of Lehtinen et al.
///     dense     value = coarse_scale; every link is kept
///     flat      value = share of R_0: one level of senders, one of receivers half as far apart
///     rays, receiver_levels, sender_levels, threshold, bounces: one parameter alone, at twice the
///               usual spacing; threshold in units of the usual
///
/// `brief`: a few coarse points of spacing, target, path and paper.
std::vector<ChartSetting> chart_settings(bool brief, std::uint64_t seed);

/// A picture of an operator's error: seen from an open place, what the hardest of the trials' lights lights.
struct ErrorMap {
    int width = 0, height = 0;
    double rel_rmse = 0.0, reference_error = 0.0; // of the picture
    /// Of each pixel, rows from the top, relative to the picture's mean irradiance: the reference, and what the
    /// operator says more. Negative and zero where nothing is seen.
    std::vector<float> reference, difference;
};

/// Measures settings of one scene, all with the same lights and places.
class ChartBench {
public:
    /// `brief`: with a reference of 5 instead of 2 %. `folder`: where a transfer file lies while its size
    /// is read. Keeps a reference to the surface. Throws Error where hardly anything is in sight.
    ChartBench(const Surface& surface, std::string folder, bool brief, std::uint64_t seed);
    ChartPoint measure(const ChartSetting& setting) const;
    /// Of a precomputation with default settings.
    ErrorMap error_map() const;
    /// R_0 that precompute() finds by itself [world]: of the first point with one.
    void set_usual_radius(float radius) { usual_radius_ = radius; }

private:
    const Surface& surface_;
    std::string folder_;
    std::uint64_t seed_;
    Verifier verifier_;
    float usual_radius_ = 0.0f;

    ChartPoint measure_paths(const ChartSetting& setting) const;
};

} // namespace afterglow
