#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/sampling.h"
#include "tests/bench/accuracy_points.h"
#include "transport/display.h"
#include "transport/measures.h"
#include "transport/precompute.h"
#include "transport/provenance.h"
#include "transport/transfer_file.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>

// Accuracy over a set of scenes, run by hand; `references` traces what the others compare with.

namespace afterglow {
namespace {

using Json = nlohmann::ordered_json;

struct Common {
    std::string scenes, lights, strategy = "plain";
    std::vector<std::string> names;
    ReferenceOptions reference;
    int threads = 0;
};

void add_common_options(CLI::App& command, Common& common) {
    command.add_option("--scenes", common.scenes, "JSON list of scenes, beside their folders")
        ->envname("AFTERGLOW_SCENES");
    command.add_option("--lights", common.lights, "JSON list of lights (tests/bench/lights.json)")
        ->required();
    command.add_option("--scene", common.names, "Scenes by their names in the lists")->required();
    command.add_option("--cache", common.reference.cache, "Folder of the references")->required();
    command.add_option("--points", common.reference.points, "Points at each of two places")
        ->check(CLI::Range(1, 1000000));
    command.add_option("--target-error", common.reference.target_error,
                       "Relative standard error of each light's reference");
    command.add_option("--max-samples", common.reference.max_samples,
                       "Mean paths a point at which tracing gives up");
    command.add_option("--strategy", common.strategy, "Of the path tracer: plain or connected");
    command.add_option("--threads", common.threads, "Threads to use (0: all processors)");
}

void print_reference(const AccuracyScene& scene, const AccuracyReference& reference) {
    const IrradianceEstimate& e = reference.irradiance;
    const auto points = static_cast<double>(reference.points.size());
    std::printf("%s: %.0f points, %.0f paths each, %.3g rays, %s, %.2f Mrays/s%s\n",
                scene.name.c_str(), points, static_cast<double>(e.samples) / points,
                static_cast<double>(e.rays), duration_text(reference.seconds).c_str(),
                static_cast<double>(e.rays) / reference.seconds * 1e-6,
                reference.from_cache ? " (cached)" : "");
    for (Index l = 0; l < 3; ++l) {
        double direct = 0.0, indirect = 0.0;
        for (Index k = l; k < e.indirect.cols(); k += 3) {
            direct += e.direct.col(k).mean();
            indirect += e.indirect.col(k).mean();
        }
        std::printf("  light %lld: mean direct %.4g, indirect %.4g W/m^2, standard error %.2f %%\n",
                    static_cast<long long>(l + 1), direct / points, indirect / points,
                    100.0 * e.relative_error[static_cast<std::size_t>(l)]);
    }
    std::fflush(stdout);
}

void run_references(const Common& common) {
    const ThreadLimit limit(common.threads);
    for (const std::string& name : common.names) {
        const AccuracyScene described = find_accuracy_scene(name, common.scenes, common.lights);
        const Scene scene = load_scene(described.path);
        const Surface surface(scene);
        Progress progress(name, true);
        ReferenceOptions options = common.reference;
        options.tracer.strategy = strategy_from_name(common.strategy);
        options.tracer.progress = [&](double share) { progress.update(share); };
        print_reference(described, accuracy_reference(surface, described, options));
    }
}

struct MeasureOptions {
    PrecomputeOptions precompute;
    std::string json;
};

void add_measure_options(CLI::App& command, MeasureOptions& options) {
    PrecomputeOptions& p = options.precompute;
    command.add_flag_callback(
        "--paper", [&p] { p = PrecomputeOptions::paper(); },
        "The paper's operator with its defaults, which the options below change");
    command.add_option("--bounces", p.bounces);
    command.add_option("--rays", p.links.rays);
    command.add_option("--most-rays", p.links.most_rays);
    command.add_option("--epsilon", p.links.threshold);
    command.add_option("--footprint-angle", p.links.footprint_angle);
    command.add_option("--coarse-radius", p.coarse_radius);
    command.add_option("--receiver-levels", p.receiver_levels);
    command.add_option("--sender-levels", p.sender_levels);
    command.add_option("--openness-density", p.openness_density);
    command.add_option("--sender-density", p.sender_density);
    command.add_option("--seed", p.seed);
    command.add_option("--json", options.json, "File for all figures");
}

/// Indirect irradiance at the reference's points; column 3 * point + light.
Eigen::Array3Xf displayed_irradiance(const Surface& surface, const TransferOperator& transfer,
                                     const AccuracyScene& scene,
                                     const std::vector<SurfacePoint>& points, Index& uncovered) {
    const LightTransport transport(transfer, surface);
    const Display display(transfer, surface);
    Eigen::Array3Xf irradiance(3, 3 * static_cast<Index>(points.size()));
    for (Index l = 0; l < 3; ++l) {
        const Spotlight& light = scene.lights[static_cast<std::size_t>(l)];
        irradiance(Eigen::all, Eigen::seq(l, Eigen::last, 3)) =
            display.irradiance(points, transport.indirect(light), light, &uncovered);
    }
    return irradiance;
}

void run_measure(const Common& common, const MeasureOptions& options) {
    const ThreadLimit limit(common.threads);
    std::printf("%-18s %5s %6s %6s %6s %6s %6s %6s %6s  errors in %% of light 1, 2, 3; "
                "reference's own error subtracted in 'net'\n",
                "scene", "light", "rmse", "net", "l1", "bias", "median", "p95", "p99");
    Json all = Json::array();
    for (const std::string& name : common.names) {
        const AccuracyScene described = find_accuracy_scene(name, common.scenes, common.lights);
        const Scene scene = load_scene(described.path);
        const Surface surface(scene);
        ReferenceOptions reference_options = common.reference;
        reference_options.tracer.strategy = strategy_from_name(common.strategy);
        const AccuracyReference reference =
            accuracy_reference(surface, described, reference_options);

        PrecomputeReport report;
        const TransferOperator transfer = precompute(surface, options.precompute, &report);
        Index uncovered = 0;
        const Eigen::Array3Xf x =
            displayed_irradiance(surface, transfer, described, reference.points, uncovered);
        const auto of_light = [](const Eigen::Array3Xf& columns, Index light) {
            Eigen::Array3Xf picked(3, columns.cols() / 3);
            for (Index p = 0; p < picked.cols(); ++p)
                picked.col(p) = columns.col(3 * p + light);
            return picked;
        };
        Json lights = Json::array();
        for (Index l = 0; l < 3; ++l) {
            const Measures m = measure(of_light(x, l), of_light(reference.irradiance.indirect, l));
            const double own = reference.irradiance.relative_error[static_cast<std::size_t>(l)];
            const double net = std::sqrt(std::max(0.0, m.rel_rmse * m.rel_rmse - own * own));
            std::printf("%-18s %5lld %6.2f %6.2f %6.2f %6.2f %6.2f %6.2f %6.2f\n", name.c_str(),
                        static_cast<long long>(l + 1), 100 * m.rel_rmse, 100 * net, 100 * m.rel_l1,
                        100 * m.bias, 100 * m.median, 100 * m.p95, 100 * m.p99);
            lights.push_back({{"rel_rmse", m.rel_rmse},
                              {"rel_rmse_net", net},
                              {"rel_l1", m.rel_l1},
                              {"bias", m.bias},
                              {"median", m.median},
                              {"p95", m.p95},
                              {"p99", m.p99},
                              {"reference_error", own}});
        }
        std::string file = name;
        std::replace(file.begin(), file.end(), ':', '_');
        file = (std::filesystem::path(common.reference.cache) / (file + ".safetensors")).string();
        save_transfer(file, transfer,
                      {.version = AFTERGLOW_VERSION,
                       .scene = described.path,
                       .scene_hash = scene.content_hash()});
        const std::uint64_t bytes = std::filesystem::file_size(file);
        std::printf(
            "%s: %zu points, %lld uncovered, %.1f s (points %.1f push %.1f pull %.1f gather %.1f rows "
            "%.1f links %.1f series %.1f), %.0fM rays, %u receivers, %u senders, %.2fM links, %.1f MB\n",
            name.c_str(), reference.points.size(), static_cast<long long>(uncovered),
            report.total_seconds, report.points_seconds, report.push_seconds,
            report.pull_seconds, report.links.trace_seconds, report.links.rows_seconds,
            report.links.links_seconds, report.series_seconds,
            1e-6 * static_cast<double>(report.links.rays), transfer.points.size(),
            transfer.senders(), 1e-6 * static_cast<double>(transfer.link_count()),
            1e-6 * static_cast<double>(bytes));
        Json entry = {
            {"scene", name},    {"points", reference.points.size()}, {"uncovered", uncovered},
            {"lights", lights}, {"seconds", report.total_seconds},   {"bytes", bytes}};
        all.push_back(entry);
        std::fflush(stdout);
    }
    if (!options.json.empty()) write_file(options.json, all.dump(1) + "\n");
}

} // namespace
} // namespace afterglow

int main(int argc, char** argv) {
    CLI::App app("Accuracy over a set of scenes", "afterglow_accuracy");
    app.require_subcommand(1);
    afterglow::Common common;
    CLI::App* references =
        app.add_subcommand("references", "Traces the references and caches them");
    afterglow::add_common_options(*references, common);
    references->callback([&] { afterglow::run_references(common); });
    afterglow::MeasureOptions measure_options;
    CLI::App* measure = app.add_subcommand(
        "measure", "Precomputes each scene and compares with its reference, under three lights");
    afterglow::add_common_options(*measure, common);
    afterglow::add_measure_options(*measure, measure_options);
    measure->callback([&] { afterglow::run_measure(common, measure_options); });
    try {
        app.parse(argc, argv);
        return 0;
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "afterglow_accuracy: %s\n", error.what());
        return 1;
    }
}
