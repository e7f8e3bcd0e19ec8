#include "transport/command_reference.h"

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "transport/cli_options.h"
#include "transport/csv_points.h"
#include "transport/path_tracer.h"
#include "transport/provenance.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>

namespace afterglow {
namespace {

struct ReferenceCommand {
    std::string scene, output, points, layer = "indirect", report, strategy = "plain";
    Spotlight light;
    Camera camera;
    Index samples = 256;
    double target_error = 0.0;
    RunOptions run;
};

/// What a run achieved, whatever it made.
struct Achieved {
    double relative_error = 0.0, seconds = 0.0;
    std::uint64_t samples = 0, rays = 0;
    bool dark = false; // nothing was found
};

std::map<std::string, std::string> provenance(const ReferenceCommand& command, const Scene& scene,
                                              const Achieved& achieved) {
    std::map<std::string, std::string> attributes = light_attributes(command.light);
    attributes.merge(std::map<std::string, std::string>{
        {"afterglow.version", AFTERGLOW_VERSION},
        {"afterglow.algorithm", "path tracing, " + command.strategy},
        {"afterglow.scene", scene.name},
        {"afterglow.scene_hash", scene.content_hash()},
        {"afterglow.seed", std::to_string(command.run.seed)},
        {"afterglow.layer", command.points.empty() ? command.layer : "irradiance"},
        {"afterglow.samples", std::to_string(achieved.samples)},
        {"afterglow.relative_standard_error", number_text(achieved.relative_error)}});
    return attributes;
}

void write_report(const std::string& path, const ReferenceCommand& command, const Scene& scene,
                  const Achieved& achieved) {
    nlohmann::json report;
    for (const auto& [name, value] : provenance(command, scene, achieved))
        report[name.substr(name.find('.') + 1)] = value;
    report["relative_standard_error"] = achieved.relative_error;
    report["samples"] = achieved.samples;
    report["rays"] = achieved.rays;
    report["seconds"] = achieved.seconds;
    report["rays_per_second"] = static_cast<double>(achieved.rays) / achieved.seconds;
    write_file(path, report.dump(1) + "\n");
}

Achieved trace_points(const ReferenceCommand& command, const Surface& surface,
                      const PathTracerOptions& options) {
    const Spotlight light = command.light.off_surfaces(surface);
    std::vector<SurfacePoint> points = read_points_csv(command.points);
    const PlacesMoved moved = surface.move_onto_surfaces(points);
    if (!command.run.quiet) tell_of_moved_places(moved, points.size());
    const IrradianceEstimate estimate =
        estimate_irradiance(surface, {&light, 1}, points, options);
    write_irradiance_csv(command.output, estimate.indirect);
    return {estimate.relative_error[0], 0.0, estimate.samples, estimate.rays, (estimate.indirect == 0.0f).all()};
}

Achieved trace_picture(const ReferenceCommand& command, const Surface& surface,
                       PathTracerOptions options) {
    options.batches = 4; // a pixel has few samples, and a picture many pixels
    PictureEstimate estimate = render_reference(surface, command.light.off_surfaces(surface), command.camera,
                                                layer_from_name(command.layer), options);
    const bool dark = std::ranges::all_of(estimate.image.rgb, [](float value) { return value == 0.0f; });
    const Achieved achieved{estimate.relative_error, 0.0, estimate.samples, estimate.rays, dark};
    estimate.image.attributes = provenance(command, surface.scene(), achieved);
    write_image(command.output, estimate.image, PixelType::full_float);
    return achieved;
}

void run(ReferenceCommand& command, bool has_camera) {
    command.light.check();
    layer_from_name(command.layer);
    strategy_from_name(command.strategy);
    if (command.points.empty()) {
        if (!has_camera)
            throw UsageError("reference needs --camera-position and --camera-target, or --points");
        command.camera.check();
        check_picture(command.output, command.camera.width, command.camera.height);
    }
    check_outputs({command.output, command.report}, {command.scene, command.points});
    check_scene_name(command.scene);
    const ThreadLimit limit(command.run.threads);
    const Scene scene = load_scene(command.scene);
    if (const std::string line = scene.summary.line(); !line.empty() && !command.run.quiet)
        std::fprintf(stderr, "%s: %s\n", command.scene.c_str(), line.c_str());
    const Surface surface(scene);

    const auto start = std::chrono::steady_clock::now();
    Achieved achieved;
    {
        Progress progress("tracing paths", !command.run.quiet);
        PathTracerOptions options;
        options.samples = command.samples;
        options.target_error = command.target_error;
        options.seed = command.run.seed;
        options.strategy = strategy_from_name(command.strategy);
        options.progress = [&](double share) { progress.update(share); };
        achieved = command.points.empty() ? trace_picture(command, surface, options)
                                          : trace_points(command, surface, options);
    }
    achieved.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (!command.report.empty()) write_report(command.report, command, scene, achieved);
    if (!command.run.quiet)
        std::fprintf(stderr, "relative standard error %.3g %% (%.3g paths, %.3g rays, %s)\n",
                     100.0 * achieved.relative_error, static_cast<double>(achieved.samples),
                     static_cast<double>(achieved.rays), duration_text(achieved.seconds).c_str());
    if (!command.run.quiet && achieved.dark)
        std::fprintf(stderr, "afterglow: warning: no path met the light%s\n",
                     command.strategy == "plain" ? "; a narrow one is found sooner by --strategy connected" : "");
    if (!command.run.quiet && command.target_error > 0.0 && achieved.relative_error > command.target_error)
        std::fprintf(stderr, "afterglow: warning: the target error of %.3g %% was not reached: so many paths are the most\n",
                     100.0 * command.target_error);
}

} // namespace

void add_reference_command(CLI::App& app) {
    CLI::App* sub = app.add_subcommand(
        "reference", "Indirect light by unbiased path tracing: a picture, or irradiance at points");
    const auto command = std::make_shared<ReferenceCommand>();
    sub->add_option("scene", command->scene, "Wavefront OBJ file or builtin:NAME")->required()->type_name("SCENE");
    sub->add_option("-o,--output", command->output,
                    "Picture (.exr, .png), or CSV file with --points")
        ->required()
        ->type_name("FILE");
    CLI::Option* points =
        sub->add_option("--points", command->points,
                        "CSV file of x,y,z,nx,ny,nz: writes the indirect irradiance "
                        "at each as E_r,E_g,E_b")->type_name("FILE");
    sub->add_option(
           "--layer", command->layer,
           "direct, indirect (radiance to the camera), full or irradiance (default indirect)")
        ->type_name("direct|indirect|full|irradiance")
        ->excludes(points);
    CLI::Option* samples =
        sub->add_option("--spp", command->samples, "Paths a pixel or point (default 256)")
            ->check(CLI::Range(Index{1}, Index{1} << 24));
    add_number(*sub, "--target-error", command->target_error,
               "Instead: trace until the relative standard error is below this share, such as 0.02")
        ->excludes(samples);
    sub->add_option(
        "--strategy", command->strategy,
        "plain, or connected: also joins paths to rays from the light, less noise a path for "
        "more time (default plain)")
        ->type_name("plain|connected");
    sub->add_option("--report", command->report, "JSON file for samples, rays, time and error")->type_name("FILE");
    add_light_options(*sub, command->light);
    add_camera_options(*sub, command->camera, false); // --points in their place
    for (CLI::Option* option : sub->get_options())
        if (option->get_group() == "Camera") option->excludes(points);
    add_run_options(*sub, command->run);
    add_seed_option(*sub, command->run);
    sub->callback([sub, command] {
        if (sub->count("--target-error") > 0 && !(command->target_error > 0.0))
            throw UsageError("--target-error must be positive");
        run(*command, camera_was_given(*sub));
    });
}

} // namespace afterglow
