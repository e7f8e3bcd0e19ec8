#include "viewer/headless.h"

#include "core/error.h"
#include "core/file.h"
#include "core/seconds.h"
#include "transport/provenance.h"
#include "viewer/frame_path.h"
#include "viewer/gl_context.h"
#include "viewer/light_solver.h"

#include <nlohmann/json.hpp>

#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>

namespace afterglow {
namespace {

using Json = nlohmann::ordered_json;

Json milliseconds(const FrameTimings& t) {
    return {{"geometry", 1e3 * t.geometry}, {"shadow_map", 1e3 * t.shadow_map},
            {"direct", 1e3 * t.direct},     {"patches", 1e3 * t.patches},
            {"indirect", 1e3 * t.indirect}, {"composition", 1e3 * t.composition},
            {"picture", 1e3 * t.total()}};
}

Json milliseconds(const MovingLightStatistics& s) {
    return {{"light_direct", 1e3 * s.direct_seconds}, {"light_coefficients", 1e3 * s.coefficients_seconds},
            {"light_links", 1e3 * s.links_seconds},   {"light_push", 1e3 * s.push_seconds},
            {"light", 1e3 * s.seconds()},             {"light_rounds", s.rounds},
            {"light_links_share", s.links_share}};
}

std::string frame_name(std::size_t k, const std::string& format) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "frame_%04zu.", k);
    return name.data() + format;
}

/// All frames once, and their timings.
Json draw_round(const std::vector<Frame>& frames, const Gl& gl, Renderer& renderer, LightSolver& solver,
                const HeadlessOptions& options) {
    Json timings = Json::array();
    for (std::size_t k = 0; k < frames.size(); ++k) {
        const Frame& frame = frames[k];
        MovingLightStatistics light;
        if (k == 0 || !frame.light.shines_alike(frames[k - 1].light)
            || (frame.light.intensity != frames[k - 1].light.intensity).any()) {
            renderer.set_light(frame.light, solver.solve(frame.light));
            light = solver.statistics();
        }
        const Image picture = renderer.average(frame.camera, options.layer, options.samples);
        if (const std::vector<std::string>& errors = gl.errors(); !errors.empty())
            throw Error("OpenGL: " + errors.front());
        const std::string name = frame_name(k, options.format);
        write_image((std::filesystem::path(options.folder) / name).string(), picture,
                    PixelType::half_float,
                    is_light(options.layer) ? std::optional(options.exposure) : std::nullopt);
        Json entry = {{"frame", name}, {"time", frame.time}};
        entry.update(milliseconds(light));
        entry.update(milliseconds(renderer.timings()));
        entry["uncovered_pixels"] = renderer.uncovered_pixels();
        timings.push_back(entry);
    }
    return timings;
}

} // namespace

void draw_frames(const TransferScene& scene, const HeadlessOptions& options) {
    std::vector<Frame> frames = read_frame_path(options.frames);
    for (Frame& frame : frames) {
        frame.camera.width = options.width;
        frame.camera.height = options.height;
        frame.camera.check();
        frame.light = frame.light.off_surfaces(scene.surface);
    }
    make_folder(options.folder);
    const std::string timings_file = (std::filesystem::path(options.folder) / "timings.json").string();
    check_outputs({timings_file}, {options.frames});

    const std::unique_ptr<GlContext> context = make_offscreen_context(options.context);
    Renderer renderer(context->gl(), scene, options.method);
    LightSolver solver(scene, 0);
    const auto start = std::chrono::steady_clock::now();
    int rounds = 0;
    Json timings;
    do {
        timings = draw_round(frames, context->gl(), renderer, solver, options);
        ++rounds;
    } while (seconds_since(start) < options.seconds);

    const Json report = {{"version", AFTERGLOW_VERSION},
                         {"opengl", context->gl().renderer()},
                         {"indirect", indirect_method_name(renderer.method())},
                         {"layer", view_layer_name(options.layer)},
                         {"width", options.width},
                         {"height", options.height},
                         {"samples", options.samples},
                         {"rounds", rounds},
                         {"unit", "ms"},
                         {"frames", timings}};
    write_file(timings_file, report.dump(1) + "\n");
}

} // namespace afterglow
