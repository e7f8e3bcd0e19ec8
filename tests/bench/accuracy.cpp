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
#include <numeric>
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

void add_scene_options(CLI::App& command, Common& common) {
    command.add_option("--scenes", common.scenes, "JSON list of scenes, beside their folders")
        ->envname("AFTERGLOW_SCENES");
    command.add_option("--lights", common.lights, "JSON list of lights (tests/bench/lights.json)")
        ->required();
    command.add_option("--scene", common.names, "Scenes by their names in the lists")->required();
    command.add_option("--points", common.reference.points, "Points at each of two places")
        ->check(CLI::Range(1, 1000000));
    command.add_option("--threads", common.threads, "Threads to use (0: all processors)");
}

void add_reference_options(CLI::App& command, Common& common) {
    command.add_option("--cache", common.reference.cache, "Folder of the references")->required();
    command.add_option("--target-error", common.reference.target_error,
                       "Relative standard error of each light's reference");
    command.add_option("--max-samples", common.reference.max_samples,
                       "Mean paths a point at which tracing gives up");
    command.add_option("--strategy", common.strategy, "Of the path tracer: plain or connected");
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
    int worst = 0;
};

/// The points that add most to the squared error under a light.
void print_worst(const std::vector<SurfacePoint>& points, const Eigen::Array3Xf& estimate,
                 const Eigen::Array3Xf& reference, int count) {
    const Eigen::ArrayXf squared = (estimate - reference).square().colwise().sum().transpose();
    std::vector<Index> order(points.size());
    std::iota(order.begin(), order.end(), Index{0});
    std::sort(order.begin(), order.end(), [&](Index a, Index b) { return squared[a] > squared[b]; });
    const auto shown = std::min<std::size_t>(count, order.size());
    for (const Index p : std::span(order).first(shown)) {
        const SurfacePoint& x = points[p];
        std::printf("    %5.1f %% of the squared error at %.3f %.3f %.3f, normal %.2f %.2f %.2f: %.3g where %.3g "
                    "is right, mean %.3g\n",
                    100.0f * squared[p] / squared.sum(), x.position.x(), x.position.y(), x.position.z(),
                    x.normal.x(), x.normal.y(), x.normal.z(), estimate.col(p).mean(),
                    reference.col(p).mean(), reference.mean());
    }
}

void add_precompute_options(CLI::App& command, PrecomputeOptions& p) {
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
            const Eigen::Array3Xf estimate = of_light(x, l);
            const Eigen::Array3Xf right = of_light(reference.irradiance.indirect, l);
            const Measures m = measure(estimate, right);
            const double own = reference.irradiance.relative_error[static_cast<std::size_t>(l)];
            const double net = std::sqrt(std::max(0.0, m.rel_rmse * m.rel_rmse - own * own));
            std::printf("%-18s %5lld %6.2f %6.2f %6.2f %6.2f %6.2f %6.2f %6.2f\n", name.c_str(),
                        static_cast<long long>(l + 1), 100 * m.rel_rmse, 100 * net, 100 * m.rel_l1,
                        100 * m.bias, 100 * m.median, 100 * m.p95, 100 * m.p99);
            print_worst(reference.points, estimate, right, options.worst);
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

struct MottlingOptions {
    PrecomputeOptions precompute;
    int seeds = 4;
};

/// Pairs of neighbours in the list: each point that has one beside it on the same surface, at this distance, and
/// that one.
std::vector<SurfacePoint> close_pairs(const Surface& surface, const std::vector<SurfacePoint>& points,
                                      float distance) {
    std::vector<SurfacePoint> pairs;
    Rng rng(1, 0x3077);
    for (const SurfacePoint& x : points) {
        const float angle = 2.0f * static_cast<float>(M_PI) * rng.uniform();
        const Vec3 aside = Frame(x.normal).to_world(Vec3(std::cos(angle), std::sin(angle), 0.0f));
        const Vec3 above = x.position + distance * (aside + 0.1f * x.normal);
        const Hit hit = surface.closest_hit({above, -x.normal, 0.2f * distance});
        if (!hit) continue;
        const SurfacePoint y = surface.point(hit);
        if (y.normal.dot(x.normal) < 0.95f) continue;
        pairs.push_back(x);
        pairs.push_back(y);
    }
    return pairs;
}

/// How mottled a picture is: what irradiance at one point against another close by differs from seed to seed,
/// as a standard deviation of one point against the irradiance there. No error against a reference tells it
/// from error that is spread out evenly, but the eye does.
void run_mottling(const Common& common, const MottlingOptions& options) {
    const ThreadLimit limit(common.threads);
    std::printf("%-18s %5s %8s %8s %8s  %% of the irradiance there, over %d seeds\n", "scene", "light",
                "median", "p90", "p99", options.seeds);
    for (const std::string& name : common.names) {
        const AccuracyScene described = find_accuracy_scene(name, common.scenes, common.lights);
        const Scene scene = load_scene(described.path);
        const Surface surface(scene);
        const std::vector<SurfacePoint> visible =
            visible_points(surface, described, common.reference.points, common.reference.seed);
        std::vector<SurfacePoint> pairs;
        Eigen::ArrayXXf at_one, difference; // (pair, light) x seed, of means over r, g, b
        for (int seed = 0; seed < options.seeds; ++seed) {
            PrecomputeOptions precompute_options = options.precompute;
            precompute_options.seed += static_cast<std::uint64_t>(seed);
            const TransferOperator transfer = precompute(surface, precompute_options);
            if (seed == 0) {
                pairs = close_pairs(surface, visible, 0.5f * transfer.points.spacing.back());
                at_one.resize(3 * static_cast<Index>(pairs.size() / 2), options.seeds);
                difference.resizeLike(at_one);
            }
            Index uncovered = 0;
            const Eigen::Array3Xf x = displayed_irradiance(surface, transfer, described, pairs, uncovered);
            for (Index row = 0; row < at_one.rows(); ++row) {
                const Index one = 6 * (row / 3) + row % 3, other = one + 3; // columns are 3 * point + light
                at_one(row, seed) = x.col(one).mean();
                difference(row, seed) = at_one(row, seed) - x.col(other).mean();
            }
        }
        for (Index l = 0; l < 3; ++l) {
            std::vector<float> mottling;
            for (Index k = l; k < at_one.rows(); k += 3) {
                const float level = at_one.row(k).mean();
                const float spread = (difference.row(k) - difference.row(k).mean()).square().sum()
                                     / static_cast<float>(2 * (options.seeds - 1));
                if (level > 0.0f) mottling.push_back(std::sqrt(spread) / level);
            }
            std::sort(mottling.begin(), mottling.end());
            const auto quantile = [&](double q) {
                return 100.0f * mottling[static_cast<std::size_t>(q * static_cast<double>(mottling.size() - 1))];
            };
            if (mottling.empty()) continue;
            std::printf("%-18s %5lld %8.2f %8.2f %8.2f\n", name.c_str(), static_cast<long long>(l + 1),
                        quantile(0.5), quantile(0.9), quantile(0.99));
        }
        std::fflush(stdout);
    }
}

} // namespace
} // namespace afterglow

int main(int argc, char** argv) {
    CLI::App app("Accuracy over a set of scenes", "afterglow_accuracy");
    app.require_subcommand(1);
    afterglow::Common common;
    CLI::App* references =
        app.add_subcommand("references", "Traces the references and caches them");
    afterglow::add_scene_options(*references, common);
    afterglow::add_reference_options(*references, common);
    references->callback([&] { afterglow::run_references(common); });
    afterglow::MeasureOptions measure_options;
    CLI::App* measure = app.add_subcommand(
        "measure", "Precomputes each scene and compares with its reference, under three lights");
    afterglow::add_scene_options(*measure, common);
    afterglow::add_reference_options(*measure, common);
    afterglow::add_precompute_options(*measure, measure_options.precompute);
    measure->add_option("--json", measure_options.json, "File for all figures");
    measure->add_option("--worst", measure_options.worst,
                        "Show so many points that add most to the error of each light")
        ->check(CLI::NonNegativeNumber);
    measure->callback([&] { afterglow::run_measure(common, measure_options); });
    afterglow::MottlingOptions mottling_options;
    CLI::App* mottling = app.add_subcommand(
        "mottling", "Precomputes each scene with several seeds and compares what close points differ by");
    afterglow::add_scene_options(*mottling, common);
    afterglow::add_precompute_options(*mottling, mottling_options.precompute);
    mottling->add_option("--seeds", mottling_options.seeds, "Seeds one after the other, from --seed on")
        ->check(CLI::Range(2, 1000));
    mottling->callback([&] { afterglow::run_mottling(common, mottling_options); });
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
