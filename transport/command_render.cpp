#include "transport/command_render.h"

#include "core/error.h"
#include "core/parallel.h"
#include "transport/cli_options.h"
#include "transport/provenance.h"
#include "transport/renderer.h"
#include "transport/transfer_scene.h"

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdio>
#include <map>
#include <memory>

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;

struct RenderCommand {
    std::string file, scene, output, layer = "indirect";
    Spotlight light;
    Camera camera;
    int samples = 4, gap_paths = 256;
    double exposure = 0.18;
    RunOptions run;
};

std::map<std::string, std::string> attributes(const RenderCommand& command,
                                              const TransferScene& opened,
                                              std::uint64_t uncovered_pixels) {
    const TransferProvenance& provenance = opened.file.provenance;
    std::map<std::string, std::string> all = light_attributes(command.light);
    all.merge(std::map<std::string, std::string>{
        {"afterglow.version", AFTERGLOW_VERSION},
        {"afterglow.algorithm", "precomputed transport"},
        {"afterglow.transfer", command.file},
        {"afterglow.transfer_version", provenance.version},
        {"afterglow.transfer_options", provenance.options},
        {"afterglow.scene", opened.scene.name},
        {"afterglow.scene_hash", provenance.scene_hash},
        {"afterglow.seed", std::to_string(provenance.seed)},
        {"afterglow.layer", command.layer},
        {"afterglow.samples_per_pixel", std::to_string(command.samples)},
        {"afterglow.gap_paths", std::to_string(command.gap_paths)},
        {"afterglow.uncovered_pixels", std::to_string(uncovered_pixels)}});
    return all;
}

void run(RenderCommand& command) {
    const Layer layer = layer_from_name(command.layer);
    command.light.check();
    command.camera.check();
    check_outputs({command.output}, {command.file, command.scene});
    check_picture(command.output, command.camera.width, command.camera.height);
    const ThreadLimit limit(command.run.threads);
    const TransferScene opened(command.file, command.scene);
    check_outputs({command.output}, {opened.scene.name});
    if (!command.run.quiet) tell_of_outside_files(opened.scene);

    const auto start = Clock::now();
    NeumannStatistics neumann;
    VectorIrradiance field;
    const Spotlight light = command.light.off_surfaces(opened.surface);
    if (layer != Layer::direct) field = opened.transport.indirect(light, &neumann);
    const auto lit = Clock::now();
    RenderedPicture picture = render_picture(opened.surface, opened.display, field, light,
                                             command.camera, layer, command.samples,
                                             command.gap_paths);
    const auto rendered = Clock::now();
    picture.image.attributes = attributes(command, opened, picture.uncovered_pixels);
    write_image(command.output, picture.image, PixelType::half_float,
                static_cast<float>(command.exposure));

    if (command.run.quiet) return;
    if (picture.uncovered_pixels > 0)
        std::fprintf(stderr,
                     "afterglow: warning: %llu pixels show places that no function covers\n",
                     static_cast<unsigned long long>(picture.uncovered_pixels));
    const auto seconds = [](auto time) { return std::chrono::duration<double>(time).count(); };
    std::fprintf(stderr, "light %.3f s (%d products), picture %.3f s\n", seconds(lit - start),
                 neumann.products, seconds(rendered - lit));
}

} // namespace

void add_render_command(CLI::App& app) {
    CLI::App* sub = app.add_subcommand("render", "A picture from a transfer file, under any light");
    const auto command = std::make_shared<RenderCommand>();
    sub->add_option("file", command->file, "Transfer file")->required()->type_name("FILE");
    sub->add_option("-o,--output", command->output, "Picture (.exr, .png)")->required()->type_name("FILE");
    sub->add_option(
        "--layer", command->layer,
        "direct, indirect (radiance to the camera), full or irradiance (default indirect)")
        ->type_name("direct|indirect|full|irradiance");
    sub->add_option("--samples", command->samples, "Samples a pixel (default 4)")
        ->check(CLI::Range(1, 4096));
    sub->add_option("--gap-paths", command->gap_paths,
                    "Paths a pixel in narrow gaps, 0 to show what the viewer shows (default 256)")
        ->check(CLI::Range(0, 65536));
    add_number(*sub, "--exposure", command->exposure,
               "Key of the tone map, for .png alone (default 0.18)");
    sub->add_option("--scene", command->scene, "Where the scene is now")->type_name("SCENE");
    add_light_options(*sub, command->light);
    add_camera_options(*sub, command->camera, true);
    add_run_options(*sub, command->run);
    sub->callback([command] {
        if (!(command->exposure > 0.0)) throw UsageError("--exposure must be positive");
        run(*command);
    });
}

} // namespace afterglow
