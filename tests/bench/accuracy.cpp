#include "core/error.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "tests/bench/accuracy_points.h"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>

// Accuracy over a set of scenes, run by hand; `references` traces what the others compare with.

namespace afterglow {
namespace {

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
