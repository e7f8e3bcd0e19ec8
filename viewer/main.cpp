#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "transport/cli_options.h"
#include "transport/manual.h"
#include "transport/processor.h"
#include "transport/program.h"
#include "viewer/headless.h"
#include "viewer/viewer_app.h"

#include <CLI/CLI.hpp>

namespace {

using namespace afterglow;

const ManualText manual = {
    .description =
        "Shows a transfer file that afterglow precompute has made, with a light and a camera that can be moved: in "
        "a window, or without one, for the frames of a path.",
    .see_also = "afterglow(1)"};

struct ViewCommand {
    std::string file, scene, layer = "full", method = "auto";
    bool headless = false;
    double exposure = 0.18;
    Camera size = {.width = 1280, .height = 720}; // of the picture alone
    HeadlessOptions frames;
    int threads = 0;
};

void add_options(CLI::App& app, ViewCommand& command) {
    app.add_option("file", command.file, "Transfer file; in a window also a scene (.obj)")
        ->required()
        ->type_name("FILE");
    app.add_option("--scene", command.scene, "Where the scene is now")->type_name("SCENE");
    app.add_flag("--headless", command.headless, "No window: draw the frames of a path");
    app.add_option("--frames", command.frames.frames, "Path of camera and light (.json)")->type_name("FILE");
    app.add_option("-o,--output", command.frames.folder, "Folder of frames, pictures and recorded paths")
        ->type_name("FOLDER");
    app.add_option("--format", command.frames.format, "Of the frames: png or exr (default png)")
        ->check(CLI::IsMember({"png", "exr"}));
    app.add_option("--samples", command.frames.samples, "Samples a pixel of the frames (default 4)")
        ->check(CLI::Range(1, 4096));
    add_number(app, "--seconds", command.frames.seconds,
               "Draw the path over and over, until so long has passed (default 0: once)");
    app.add_option("--context", command.frames.context,
                   "OpenGL's: auto, glfw (a window), egl or osmesa (default auto)")
        ->check(CLI::IsMember({"auto", "glfw", "egl", "osmesa"}));
    app.add_option("--indirect", command.method,
                   "How indirect light is drawn: splat, gather or auto, the faster (default auto)")
        ->type_name("splat|gather|auto");
    app.add_option("--layer", command.layer,
                   "full, direct, indirect, irradiance, reflectance or normals (default full)")
        ->type_name("full|direct|indirect|irradiance|reflectance|normals");
    add_size_option(app, command.size);
    add_number(app, "--exposure", command.exposure, "Key of the tone map (default 0.18)");
    app.add_option("--threads", command.threads, "Threads to use (default 0: all processors)")
        ->check(CLI::Range(0, 4096));
}

void open_window(const CLI::App& app, const ViewCommand& command) {
    const HeadlessOptions& frames = command.frames;
    for (const char* option : {"--format", "--samples", "--seconds"})
        if (app.count(option) > 0) throw UsageError(std::string(option) + " is of --headless");
    if (frames.context != "auto" && frames.context != "glfw")
        throw UsageError("--context " + frames.context + " has no window; give --headless");
    if (is_scene(command.file) && !command.scene.empty()) throw UsageError("--scene is of transfer files");
    ViewerOptions options;
    options.file = command.file;
    options.scene = command.scene;
    options.frames = frames.frames;
    options.method = frames.method;
    options.layer = frames.layer;
    options.width = frames.width;
    options.height = frames.height;
    options.exposure = frames.exposure;
    options.threads = command.threads;
    if (!frames.folder.empty()) {
        make_folder(frames.folder);
        options.folder = frames.folder;
    }
    ViewerApp(options).run();
}

void run(const CLI::App& app, ViewCommand& command) {
    if (!(command.exposure > 0.0)) throw UsageError("--exposure must be positive");
    HeadlessOptions& frames = command.frames;
    if (!(frames.seconds >= 0.0)) throw UsageError("--seconds must not be negative");
    frames.layer = view_layer_from_name(command.layer);
    frames.method = indirect_method_from_name(command.method);
    frames.exposure = static_cast<float>(command.exposure);
    frames.width = command.size.width;
    frames.height = command.size.height;
    const ThreadLimit limit(command.threads);
    if (!command.headless) {
        open_window(app, command);
        return;
    }
    if (frames.frames.empty() || frames.folder.empty())
        throw UsageError("--headless needs --frames PATH.json and -o FOLDER");
    if (frames.context == "glfw") throw UsageError("--headless has no window: --context egl or osmesa");
    const TransferScene scene(command.file, command.scene);
    tell_of_outside_files(scene.scene);
    draw_frames(scene, frames);
}

} // namespace

int main(int argc, char** argv) {
    run_faster_twin(argv);
    CLI::App app("Interactive indirect light from a transfer file", "afterglow-view");
    app.set_version_flag("--version", AFTERGLOW_VERSION);
    add_manual_options(app, manual);
    ViewCommand command;
    add_options(app, command);
    return run_program(app, argc, argv, [&] { run(app, command); });
}
