#include "transport/command_chart.h"

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "transport/chart.h"
#include "transport/chart_figures.h"
#include "transport/cli_options.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace afterglow {
namespace {

using Json = nlohmann::ordered_json;

struct ChartCommand {
    std::vector<std::string> scenes;
    std::string output;
    bool brief = false;
    std::vector<std::string> sweeps; // those that are measured; empty: all
    double max_time = std::numeric_limits<double>::infinity(); // of a search for a spacing [s]
    RunOptions run;
};

/// What a search was limited to [s]; 0: by nothing, or no search.
double limit_of(const ChartSetting& setting) {
    return setting.target && std::isfinite(setting.most_seconds) ? setting.most_seconds : 0.0;
}

Json point_json(const std::string& scene, const std::string& hash, const ChartSetting& setting, const ChartPoint& p) {
    return {{"scene", scene},
            {"scene_hash", hash},
            {"sweep", p.sweep},
            {"value", p.value},
            {"max_time", limit_of(setting)},
            {"seconds", p.seconds},
            {"update_seconds", p.update_seconds},
            {"bytes", p.bytes},
            {"functions", p.functions},
            {"links", p.links},
            {"rays", p.rays},
            {"coarse_radius", p.coarse_radius},
            {"points_seconds", p.points_seconds},
            {"push_seconds", p.push_seconds},
            {"pull_seconds", p.pull_seconds},
            {"gather_seconds", p.gather_seconds},
            {"rows_seconds", p.rows_seconds},
            {"links_seconds", p.links_seconds},
            {"series_seconds", p.series_seconds},
            {"tuning_seconds", p.tuning_seconds},
            {"rel_rmse", p.error.rel_rmse},
            {"standard_error", p.error.standard_error},
            {"worst", p.error.worst},
            {"senders_error", p.parts.senders.rms},
            {"links_error", p.parts.links.rms},
            {"receivers_error", p.parts.receivers.rms},
            {"reference_error", p.error.reference_error}};
}

Json map_json(const std::string& scene, const ErrorMap& map) {
    return {{"scene", scene},           {"width", map.width},
            {"height", map.height},     {"rel_rmse", map.rel_rmse},
            {"reference_error", map.reference_error},
            {"reference", map.reference}, {"difference", map.difference}};
}

/// As the figures' names have it.
std::string file_name(std::string scene) {
    std::replace_if(scene.begin(), scene.end(), [](char c) { return c == ':' || c == '/'; }, '_');
    return scene;
}

/// The processor's name, where the system tells it.
std::string machine() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("model name")) {
            const std::size_t colon = line.find(": ");
            if (colon != std::string::npos) return line.substr(colon + 2);
        }
    return "unknown processor";
}

/// DIR/runs.json: what is measured already, and is not measured again.
class Runs {
public:
    Runs(std::string folder, bool brief, const RunOptions& run) : folder_(std::move(folder)) {
        const std::string path = file();
        head_ = {{"version", AFTERGLOW_VERSION}, {"machine", machine()}, {"threads", thread_count()},
                 {"seed", run.seed}, {"brief", brief}, {"lights", chart_lights}, {"places", chart_places}};
        if (!std::filesystem::exists(path)) return;
        std::ifstream stream(path);
        const Json json = Json::parse(stream, nullptr, false);
        if (json.is_discarded() || !json.contains("runs") || !json["runs"].is_array())
            throw FileError(path, "is not what a chart has left here");
        for (const char* key : {"version", "machine", "threads", "seed", "brief"})
            if (json.value(key, Json()) != head_[key])
                throw UsageError(path + " was made with another value of '" + key + "'; name another folder");
        runs_ = json["runs"];
    }
    /// The point, if it is there. Throws UsageError where it was searched with another limit.
    const Json* find(const std::string& scene, const ChartSetting& setting) const {
        for (const Json& run : runs_)
            if (run.value("scene", "") == scene && run.value("sweep", "") == setting.sweep
                && run.value("value", -1.0) == setting.value) {
                if (run.value("max_time", 0.0) != limit_of(setting))
                    throw UsageError(file() + " has targets searched with another --max-time; name another folder");
                return &run;
            }
        return nullptr;
    }
    /// Throws UsageError where points of another scene go by this name.
    void expect_scene(const std::string& scene, const std::string& hash) const {
        for (const Json& run : runs_)
            if (run.value("scene", "") == scene && run.value("scene_hash", "") != hash)
                throw UsageError(file() + " has points of another scene called " + scene + "; name another folder");
    }
    void add(Json point) {
        runs_.push_back(std::move(point));
        Json all = head_;
        all["runs"] = runs_;
        write_file(file(), all.dump(1) + "\n");
        std::ostringstream csv;
        for (bool first = true; const auto& [key, value] : runs_[0].items()) {
            csv << (first ? "" : ",") << key;
            first = false;
        }
        csv << "\n";
        for (const Json& run : runs_) {
            for (bool first = true; const auto& [key, value] : run.items()) {
                csv << (first ? "" : ",") << value.dump();
                first = false;
            }
            csv << "\n";
        }
        write_file(folder_ + "/runs.csv", csv.str());
    }
    std::string file() const { return folder_ + "/runs.json"; }

private:
    std::string folder_;
    Json head_, runs_ = Json::array();
};

/// Whether a setting is meant by "SWEEP" or "SWEEP=VALUE".
bool is_meant(const ChartSetting& setting, const std::string& by) {
    const std::size_t equals = by.find('=');
    return setting.sweep == by.substr(0, equals)
           && (equals == std::string::npos
               || static_cast<float>(setting.value) == parse_numbers("--sweeps", by.substr(equals + 1), 1)[0]);
}

/// Those that are asked for; with the first one before any that is relative to the radius it tells.
std::vector<ChartSetting> wanted_settings(const ChartCommand& command) {
    std::vector<ChartSetting> settings = chart_settings(command.brief && command.sweeps.empty(), command.run.seed);
    for (const std::string& sweep : command.sweeps)
        if (std::none_of(settings.begin(), settings.end(), [&](const ChartSetting& s) { return is_meant(s, sweep); }))
            throw UsageError("--sweeps knows no '" + sweep + "'");
    const auto is_wanted = [&](const ChartSetting& setting) {
        return command.sweeps.empty()
               || std::any_of(command.sweeps.begin(), command.sweeps.end(),
                              [&](const std::string& sweep) { return is_meant(setting, sweep); });
    };
    const bool by_radius = std::any_of(settings.begin(), settings.end(), [&](const ChartSetting& s) {
        return s.radius_share > 0.0f && is_wanted(s);
    });
    std::erase_if(settings, [&, first = true](const ChartSetting& s) mutable {
        const bool tells_radius = std::exchange(first, false) && by_radius;
        return !is_wanted(s) && !tells_radius;
    });
    for (ChartSetting& setting : settings) setting.most_seconds = command.max_time;
    return settings;
}

void measure_scene(const ChartCommand& command, const std::string& path, Runs& runs) {
    const std::vector<ChartSetting> settings = wanted_settings(command);
    const std::string name = path.starts_with("builtin:") ? path : std::filesystem::path(path).stem().string();
    const Scene scene = load_scene(path);
    const std::string hash = scene.content_hash();
    runs.expect_scene(name, hash);
    const std::string map_file = command.output + "/map_" + file_name(name) + ".json";
    const bool wants_map = !command.brief && command.sweeps.empty() && !std::filesystem::exists(map_file);
    const bool is_done = std::all_of(settings.begin(), settings.end(), [&](const ChartSetting& setting) {
        return runs.find(name, setting) != nullptr;
    });
    if (is_done && !wants_map) return;
    const Surface surface(scene);
    if (!command.run.quiet) std::fprintf(stderr, "%s: tracing the reference\n", name.c_str());
    ChartBench bench(surface, command.output, command.brief, command.run.seed);
    for (const ChartSetting& setting : settings) {
        if (!runs.find(name, setting)) {
            const ChartPoint point = bench.measure(setting);
            runs.add(point_json(name, hash, setting, point));
            if (!command.run.quiet)
                std::fprintf(stderr, "%s: %s %g: error %.1f %% +- %.1f, %s, %.1f MB\n", name.c_str(),
                             setting.sweep.c_str(), setting.value, 100.0 * point.error.rel_rmse,
                             100.0 * point.error.standard_error, duration_text(point.seconds).c_str(),
                             1e-6 * static_cast<double>(point.bytes));
        }
        if (setting.sweep == "spacing")
            bench.set_usual_radius(runs.find(name, setting)->value("coarse_radius", 0.0f)
                                   / setting.options.coarse_scale);
    }
    if (wants_map) {
        if (!command.run.quiet) std::fprintf(stderr, "%s: a picture of the error\n", name.c_str());
        write_file(map_file, map_json(name, bench.error_map()).dump() + "\n");
    }
}

/// By a Python program that lies beside the figures afterwards, so that anyone can draw them anew.
void draw(const ChartCommand& command) {
    const std::string program = command.output + "/figures.py";
    write_file(program, chart_figures_program);
    std::string quoted = "'";
    for (const char c : program) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    quoted += "'";
    // The system's own Python too, as another in front of it may lack matplotlib.
    const std::string line = "for python in python3 /usr/bin/python3; do if $python -c 'import matplotlib' 2>/dev/null; "
                             "then exec $python " + quoted + " 2>/dev/null; fi; done; exit 1";
    if (std::system(line.c_str()) != 0)
        throw Error("the figures could not be drawn; with matplotlib installed, run python3 " + program);
}

void run(const ChartCommand& command) {
    if (!(command.max_time > 0.0)) throw UsageError("--max-time must be positive");
    const ThreadLimit limit(command.run.threads);
    make_folder(command.output);
    Runs runs(command.output, command.brief, command.run);
    for (const std::string& scene : command.scenes) measure_scene(command, scene, runs);
    draw(command);
    if (!command.run.quiet)
        std::fprintf(stderr, "%s: runs.json, runs.csv, figures as .svg and .png\n", command.output.c_str());
}

} // namespace

void add_chart_command(CLI::App& app) {
    CLI::App* sub = app.add_subcommand(
        "chart", "Sweeps over settings: error against time and bytes, measured and drawn");
    const auto command = std::make_shared<ChartCommand>();
    sub->add_option("scenes", command->scenes, "Wavefront OBJ files or builtin:NAME")->required()->type_name("SCENE");
    sub->add_option("-o,--output", command->output,
                    "Folder; what is measured there already is not measured again")->required()->type_name("FOLDER");
    sub->add_flag("--brief", command->brief, "A few coarse points alone, in seconds; of --sweeps all, against a reference of a tenth of the rays");
    sub->add_option("--sweeps", command->sweeps,
                    "Some of them alone, or a value of one (target=0.1): spacing, target, path, paper, dense, flat, "
                    "rays, receiver_levels, sender_levels, threshold, bounces")
        ->delimiter(',')
        ->allow_extra_args(false)
        ->type_name("SWEEP,...");
    add_number(*sub, "--max-time", command->max_time,
               "Limit of each search for a spacing in seconds: the sweep target then has the best that was reached");
    add_run_options(*sub, command->run);
    add_seed_option(*sub, command->run);
    sub->callback([command] { run(*command); });
}

} // namespace afterglow
