#include "transport/chart.h"

#include "core/camera.h"
#include "core/error.h"
#include "core/process_end.h"
#include "core/sampling.h"
#include "core/seconds.h"
#include "transport/display.h"
#include "transport/path_tracer.h"
#include "transport/transfer_file.h"
#include "transport/tuning.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <unistd.h>

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;

VerificationOptions trial_options(bool brief, std::uint64_t seed) {
    return {.trials = chart_trials,
            .lights = chart_lights / chart_trials,
            .places = chart_places / chart_trials,
            .reference_error = brief ? 0.05 : 0.02,
            .most_rays = brief ? 40'000'000u : 400'000'000u,
            .seed = hash64(seed, 0xc4a87)};
}

} // namespace

std::vector<ChartSetting> chart_settings(bool brief, std::uint64_t seed) {
    std::vector<ChartSetting> settings;
    PrecomputeOptions usual;
    usual.seed = seed;
    const auto add = [&](const char* sweep, std::vector<double> values, const auto& change) {
        for (const double value : values) {
            ChartSetting& setting = settings.emplace_back(ChartSetting{sweep, value, usual});
            change(setting, value);
        }
    };
    const auto full = [&](std::vector<double> few, std::vector<double> more) {
        if (!brief) few.insert(few.end(), more.begin(), more.end());
        return few;
    };
    const auto scale = [](ChartSetting& s, double v) { s.options.coarse_scale = static_cast<float>(v); };
    add("spacing", full({4.0, 2.8}, {2.0, 1.4, 1.0, 0.7}), scale);
    add("target", full({0.3, 0.2}, {0.1, 0.05, 0.03}), [](ChartSetting& s, double v) { s.target = v; });
    add("path", full({4, 16}, {64, 256}), [](ChartSetting& s, double v) { s.path_samples = static_cast<Index>(v); });
    add("paper", full({0.2}, {0.1, 0.05, 0.025}), [&](ChartSetting& s, double v) {
        s.options = PrecomputeOptions::paper();
        s.options.seed = seed;
        s.options.links.threshold = static_cast<float>(v / EIGEN_PI);
    });
    if (brief) return settings;

    add("dense", {4.0, 2.8, 2.0}, [&](ChartSetting& s, double v) {
        scale(s, v);
        s.options.links.threshold = 0.0f;
    });
    add("flat", {0.25, 0.125, 0.0884, 0.0625}, [](ChartSetting& s, double v) {
        s.options.receiver_levels = 2;
        s.options.sender_levels = 1;
        s.radius_share = static_cast<float>(v);
    });
    const auto alone = [&](const char* sweep, std::vector<double> values, const auto& change) {
        add(sweep, std::move(values), [&](ChartSetting& s, double v) {
            s.radius_share = 2.0f;
            change(s.options, v);
        });
    };
    alone("rays", {64, 128, 256, 512, 1024, 2048},
          [](PrecomputeOptions& o, double v) { o.links.rays = static_cast<int>(v); });
    alone("receiver_levels", {4, 5, 6, 7},
          [](PrecomputeOptions& o, double v) { o.receiver_levels = static_cast<int>(v); });
    alone("sender_levels", {2, 3, 4, 5, 6},
          [](PrecomputeOptions& o, double v) { o.sender_levels = static_cast<int>(v); });
    alone("threshold", {0.25, 0.5, 1, 2, 4, 8},
          [](PrecomputeOptions& o, double v) { o.links.target_error *= v; });
    alone("bounces", {1, 2, 3, 5, 0},
          [](PrecomputeOptions& o, double v) { o.bounces = static_cast<int>(v); });
    return settings;
}

ChartBench::ChartBench(const Surface& surface, std::string folder, bool brief, std::uint64_t seed)
    : surface_(surface), folder_(std::move(folder)), seed_(seed),
      verifier_(surface, find_viewpoints(surface, seed), trial_options(brief, seed)) {
    if (verifier_.trials().empty()) throw Error("hardly anything is in sight: there is nothing to chart");
}

ChartPoint ChartBench::measure_paths(const ChartSetting& setting) const {
    ChartPoint point;
    point.sweep = setting.sweep;
    point.value = setting.value;
    PathTracerOptions tracer;
    tracer.strategy = PathStrategy::connected;
    tracer.samples = setting.path_samples;
    tracer.batches = static_cast<int>(std::min<Index>(16, setting.path_samples));
    tracer.seed = hash64(seed_, 0x9a7b);
    double squares = 0.0;
    double traced = 0.0; // places, once a light
    int lights = 0;
    for (const Trial& trial : verifier_.trials())
        for (const Spotlight& light : trial.lights) {
            IrradianceEstimate estimate;
            double least = std::numeric_limits<double>::infinity(); // of several: one is a few milliseconds
            for (double spent = 0.0, taken; spent < 0.1; spent += taken) {
                const auto start = Clock::now();
                estimate = estimate_irradiance(surface_, {&light, 1}, trial.places, tracer);
                taken = seconds_since(start);
                least = std::min(least, taken);
            }
            if (!(estimate.indirect > 0.0f).any()) continue; // a light that shines out of the scene
            point.seconds += least;
            point.rays += estimate.rays;
            squares += estimate.relative_error[0] * estimate.relative_error[0];
            point.error.worst = std::max(point.error.worst, estimate.relative_error[0]);
            traced += static_cast<double>(trial.places.size());
            ++lights;
        }
    constexpr double pixels = 1280.0 * 720.0;
    if (lights > 0) {
        point.seconds *= pixels / traced;
        point.error.rel_rmse = std::sqrt(squares / lights);
    }
    point.error.lights = chart_lights;
    point.error.places = chart_places;
    return point;
}

ChartPoint ChartBench::measure(const ChartSetting& setting) const {
    if (setting.path_samples > 0) return measure_paths(setting);
    ChartPoint point;
    point.sweep = setting.sweep;
    point.value = setting.value;
    PrecomputeOptions options = setting.options;
    if (setting.radius_share > 0.0f) options.coarse_radius = setting.radius_share * usual_radius_;
    PrecomputeReport report;
    TuningReport tuning;
    TuningOptions search;
    search.target_error = setting.target.value_or(0.0);
    search.most_seconds = setting.most_seconds;
    search.judge = [&](const TransferOperator& found, const PrecomputeReport& of, int time) {
        return fresh_verifier(surface_, of, options.seed, time).error_of(found);
    };
    const auto start = Clock::now();
    const TransferOperator transfer = setting.target ? precompute_to_target(surface_, options, search, report, tuning)
                                                     : precompute(surface_, options, &report);
    point.seconds = seconds_since(start);
    point.points_seconds = report.points_seconds;
    point.push_seconds = report.push_seconds;
    point.pull_seconds = report.pull_seconds;
    point.gather_seconds = report.links.trace_seconds;
    point.rows_seconds = report.links.rows_seconds;
    point.links_seconds = report.links.links_seconds;
    point.series_seconds = report.series_seconds;
    point.tuning_seconds = point.seconds - report.total_seconds;
    point.functions = transfer.points.size();
    point.links = transfer.link_count();
    point.rays = report.links.rays + report.points_rays;
    point.coarse_radius = transfer.points.spacing[0];

    const std::string file = folder_ + "/chart.safetensors";
    const AtEarlyEnd at_early_end([&] { ::unlink(file.c_str()); });
    save_transfer(file, transfer, {AFTERGLOW_VERSION, surface_.scene().name, "", seed_, "{}", "{}"});
    point.bytes = std::filesystem::file_size(file);
    std::filesystem::remove(file);

    const LightTransport transport(transfer, surface_);
    point.update_seconds = 1e30;
    for (int k = 0; k < 3; ++k) {
        const auto begin = Clock::now();
        transport.indirect(verifier_.trials().front().lights[0]);
        point.update_seconds = std::min(point.update_seconds, seconds_since(begin));
    }
    point.error = verifier_.error_of(transfer);
    if (setting.sweep == "spacing") point.parts = verifier_.parts_of(transfer, {.places = chart_places / chart_trials, .rays = 2048});
    return point;
}

ErrorMap ChartBench::error_map() const {
    PrecomputeOptions options;
    options.seed = seed_;
    const TransferOperator transfer = precompute(surface_, options);
    const auto worst = static_cast<std::size_t>(verifier_.error_of(transfer).worst_light);
    const std::size_t lights_of_trial = verifier_.trials().front().lights.size();
    const Trial& trial = verifier_.trials()[worst / lights_of_trial];
    const std::size_t hardest = worst % lights_of_trial;
    const Spotlight& light = trial.lights[hardest];
    const Hit lit = surface_.closest_hit({light.position, light.direction});
    Camera camera{.position = trial.eyes[2 * hardest + 1], .vertical_fov = 60.0f, .width = 192, .height = 108};
    camera.target = light.position + (lit ? lit.distance : 1.0f) * light.direction;
    // An eye straight above or below what is lit has another idea of what is up.
    if ((camera.target - camera.position).normalized().cross(camera.up).norm() < 0.1f) camera.up = Vec3::UnitZ();
    camera.check();

    std::vector<SurfacePoint> places;
    std::vector<std::size_t> pixel_of;
    ErrorMap map;
    map.width = camera.width;
    map.height = camera.height;
    for (int y = 0; y < map.height; ++y)
        for (int x = 0; x < map.width; ++x)
            if (const Hit hit = surface_.closest_hit(
                    {camera.position, camera.direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)})) {
                pixel_of.push_back(static_cast<std::size_t>(y * map.width + x));
                places.push_back(surface_.point(hit));
            }
    PathTracerOptions tracer;
    tracer.strategy = PathStrategy::connected;
    tracer.target_error = 0.03;
    tracer.max_samples = 4096;
    tracer.seed = hash64(seed_, 0x3a9);
    const IrradianceEstimate reference = estimate_irradiance(surface_, {&light, 1}, places, tracer);
    const Eigen::Array3Xf found =
        Display(transfer, surface_).irradiance(places, LightTransport(transfer, surface_).indirect(light), light);
    const VerifiedError error = compare_with_reference(found, reference.indirect, reference.standard_error);
    map.rel_rmse = error.rel_rmse;
    map.reference_error = error.reference_error;
    const auto mean = static_cast<float>(reference.indirect.cast<double>().mean());
    const auto pixels = static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height);
    map.reference.assign(pixels, -1.0f);
    map.difference.assign(pixels, 0.0f);
    for (std::size_t k = 0; k < places.size(); ++k) {
        const auto column = static_cast<Index>(k);
        map.reference[pixel_of[k]] = reference.indirect.col(column).mean() / mean;
        map.difference[pixel_of[k]] = (found - reference.indirect).col(column).mean() / mean;
    }
    return map;
}

} // namespace afterglow
