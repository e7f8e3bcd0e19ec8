#include "transport/command_precompute.h"

#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"
#include "core/process_end.h"
#include "core/progress.h"
#include "core/sampling.h"
#include "transport/checkpoint.h"
#include "transport/cli_options.h"
#include "transport/error_parts.h"
#include "transport/precompute.h"
#include "transport/provenance.h"
#include "transport/transfer_file.h"
#include "transport/tuning.h"
#include "transport/verification.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

namespace afterglow {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr float draft_scale = 4.0f;

struct PrecomputeCommand {
    std::string scene, output, report, checkpoint, operator_name = "neumann";
    double target_error = LinkOptions().target_error, epsilon = 0.0, coarse_radius = 0.0;
    double max_time = 0.0, max_memory = 0.0; // [s], [GB]; 0: no limit
    double checkpoint_every = 10.0;          // [s]
    PrecomputeOptions options;
    bool draft = false, tuned = false, no_verification = false;
    RunOptions run;
};

/// Wall-clock time of what happens around precompute().
struct OuterSeconds {
    double load = 0.0, tree = 0.0, verification = 0.0, write = 0.0, total = 0.0;
};

/// Stored links, counted once: it takes a pass over them.
struct LinkCounts {
    std::vector<std::uint64_t> level;
    std::uint64_t all = 0;

    explicit LinkCounts(const TransferOperator& transfer) {
        for (int l = 0; l < transfer.points.levels(); ++l) {
            level.push_back(transfer.link_count(l));
            all += level.back();
        }
    }
};

/// The seconds since `start`, which moves on to now.
double lap(Clock::time_point& start) {
    const Clock::time_point before = std::exchange(start, Clock::now());
    return std::chrono::duration<double>(start - before).count();
}

/// To four digits: more of an error's estimate say nothing.
double rounded(double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.4g", value);
    return std::stod(text.data());
}

Json part_json(const ErrorPart& part) {
    return {rounded(part.rms), rounded(part.standard_error)};
}

Json vector_json(const Vec3& v) {
    return {v.x(), v.y(), v.z()};
}

Json options_json(const PrecomputeCommand& command) {
    const PrecomputeOptions& options = command.options;
    Json json = {{"operator", command.operator_name},
                 {"coarse_radius", command.coarse_radius},
                 {"receiver_levels", options.receiver_levels},
                 {"sender_levels", options.sender_levels},
                 {"rays", options.links.rays},
                 {"bounces", options.bounces},
                 {"seed", options.seed}};
    if (options.links.threshold)
        json["epsilon"] = std::stod(number_text(*options.links.threshold));
    else
        json["target_error"] = command.target_error;
    if (command.draft) json["draft"] = true;
    if (options.viewpoint) json["viewpoint"] = vector_json(*options.viewpoint);
    return json;
}

/// How far it is from the path tracer, and why.
struct Verification {
    VerifiedError error;
    ErrorParts parts;
};

/// Counts and measures of length: nothing that differs from run to run.
Json statistics_json(const TransferOperator& transfer, const PrecomputeReport& report,
                     const LinkCounts& links, const Verification& verified,
                     const TuningReport& tuning) {
    Json viewpoints = Json::array(), levels = Json::array();
    for (const Vec3& viewpoint : report.viewpoints)
        viewpoints.push_back(vector_json(viewpoint));
    for (int l = 0; l < transfer.points.levels(); ++l) {
        const LevelStatistics& level = report.hierarchy.level[static_cast<std::size_t>(l)];
        levels.push_back({{"functions", level.points},
                          {"candidates", level.candidates_tried},
                          {"links", links.level[static_cast<std::size_t>(l)]}});
    }
    Json json = {{"viewpoints", viewpoints},
            {"mean_ray_length", report.mean_ray_length},
            {"levels", levels},
            {"senders", transfer.senders()},
            {"links", links.all},
            {"threshold", std::stod(number_text(report.links.threshold))},
            {"links_before", report.links.links_before},
            {"rays_of_points", report.points_rays},
            {"rays_of_links", report.links.rays},
            {"patch_rows", report.links.patches},
            {"uncovered_patch_rows", report.links.uncovered_patches}};
    if (const VerifiedError& error = verified.error; error.any())
        json["verified"] = {{"rel_rmse", rounded(error.rel_rmse)},
                            {"standard_error", rounded(error.standard_error)},
                            {"worst", rounded(error.worst)},
                            {"bias", rounded(error.bias)},
                            {"reference_error", rounded(error.reference_error)},
                            {"places", error.places},
                            {"lights", error.lights}};
    if (const ErrorParts& parts = verified.parts; parts.any())
        json["verified"]["parts"] = {{"senders", part_json(parts.senders)},
                                     {"links", part_json(parts.links)},
                                     {"receivers", part_json(parts.receivers)}};
    for (const TuningStep& step : tuning.steps) {
        Json of_step = {{"coarse_scale", rounded(step.coarse_scale)},
                        {"rel_rmse", rounded(step.error.rel_rmse)},
                        {"standard_error", rounded(step.error.standard_error)}};
        if (step.judged && step.judged->any()) of_step["judged"] = rounded(step.judged->rel_rmse);
        json["tuning"].push_back(std::move(of_step));
    }
    return json;
}

Json seconds_json(const PrecomputeReport& report, const OuterSeconds& outer) {
    return {{"load", outer.load},
            {"tree", outer.tree},
            {"points", report.points_seconds},
            {"push", report.push_seconds},
            {"pull", report.pull_seconds},
            {"gather", report.links.trace_seconds},
            {"rows", report.links.rows_seconds},
            {"links", report.links.links_seconds},
            {"series", report.series_seconds},
            {"verification", outer.verification},
            {"precompute", report.total_seconds},
            {"write", outer.write},
            {"total", outer.total}};
}

void print_results(const PrecomputeCommand& command, const TransferOperator& transfer,
                   const PrecomputeReport& report, const LinkCounts& links, std::uint64_t bytes,
                   const Verification& verified, const OuterSeconds& outer) {
    const auto say = [](const char* format, auto... values) {
        std::fprintf(stderr, format, values...);
    };
    for (int l = 0; l < transfer.points.levels(); ++l) {
        const auto functions = transfer.points.end(l) - transfer.points.begin(l);
        const std::uint64_t of_level = links.level[static_cast<std::size_t>(l)];
        say("level %d: %u functions, spacing %.4g, %.1f links a function%s\n", l, functions,
            static_cast<double>(transfer.points.spacing[static_cast<std::size_t>(l)]),
            static_cast<double>(of_level) / std::max(1u, functions),
            l < transfer.sender_levels ? ", senders too" : "");
    }
    say("%s: %.1f MB, %.3g links of %.3g, %.3g rays, %s\n", command.output.c_str(),
        static_cast<double>(bytes) * 1e-6,
        static_cast<double>(links.all),
        static_cast<double>(report.links.links_before),
        static_cast<double>(report.links.rays + report.points_rays),
        duration_text(outer.total).c_str());
    if (verified.error.any()) say("verified error %s\n", verified.error.text().c_str());
    if (verified.parts.any()) say("of which %s\n", verified.parts.text().c_str());
}

TransferOperator plain_transfer(const PrecomputeCommand& command, const Surface& surface,
                                PrecomputeReport& report) {
    Progress progress("precomputing", !command.run.quiet);
    PrecomputeOptions options = command.options;
    options.progress = [&](double share) { progress.update(share); };
    return precompute(surface, options, &report);
}

/// `judge`: the verifier that the result was judged by, unless nothing is to be verified.
TransferOperator tuned_transfer(const PrecomputeCommand& command, const Surface& surface, PrecomputeReport& report,
                                TuningReport& tuning, std::optional<Verifier>& judge, double& judge_seconds) {
    std::optional<Progress> progress;
    PrecomputeOptions options = command.options;
    options.progress = [&](double share) { progress->update(share); };
    TuningOptions limits;
    limits.target_error = command.target_error;
    if (command.max_time > 0.0) limits.most_seconds = command.max_time;
    if (command.max_memory > 0.0) limits.most_bytes = 1e9 * command.max_memory;
    int number = 0;
    limits.begin_step = [&] {
        progress.emplace("precomputing, step " + std::to_string(++number), !command.run.quiet);
    };
    limits.end_step = [&](const TuningStep& step) {
        progress.reset();
        if (command.run.quiet) return;
        std::fprintf(stderr, "step %d: spacing %.3g of the usual, error %.1f %% +- %.1f, %s\n", number,
                     static_cast<double>(step.coarse_scale), 100.0 * step.error.rel_rmse,
                     100.0 * step.error.standard_error, duration_text(step.seconds).c_str());
    };
    const auto verify = [&](const TransferOperator& transfer, const PrecomputeReport& of, int time) {
        auto start = Clock::now();
        judge.emplace(fresh_verifier(surface, of, options.seed, time));
        const VerifiedError error = judge->error_of(transfer);
        judge_seconds += lap(start);
        return error;
    };
    if (!command.no_verification) limits.judge = verify;
    return precompute_to_target(surface, options, limits, report, tuning);
}

/// Says so where the target was not reached.
void print_tuning(const PrecomputeCommand& command, const TuningReport& tuning) {
    const char* reason = nullptr;
    switch (tuning.end) {
        case TuningEnd::reached: break;
        case TuningEnd::most_seconds: reason = "a finer step would exceed --max-time"; break;
        case TuningEnd::most_bytes: reason = "a finer step would exceed --max-memory"; break;
        case TuningEnd::nothing_to_compare: reason = "there is no indirect light to compare with"; break;
        case TuningEnd::finest: reason = "neither the finest spacing nor five steps would do"; break;
    }
    if (reason)
        std::fprintf(stderr, "afterglow: warning: the target error of %.3g %% was not reached: %s\n",
                     100.0 * command.target_error, reason);
}

/// Says so where there is something to go on from.
void open_checkpoint(const PrecomputeCommand& command, TransferProvenance asked,
                     std::optional<Checkpoint>& checkpoint) {
    // The options of a file do not tell a search from one step.
    if (command.tuned) asked.options = Json{{"search", Json::parse(asked.options)}}.dump();
    checkpoint.emplace(command.checkpoint, std::move(asked), command.checkpoint_every);
    if (checkpoint->found() && !command.run.quiet)
        std::fprintf(stderr, "%s: the links of %u of %u functions are there already\n", command.checkpoint.c_str(),
                     checkpoint->found()->done, checkpoint->found()->transfer.points.size());
}

void run(PrecomputeCommand& command) {
    check_outputs({command.output, command.report, command.checkpoint}, {command.scene});
    check_scene_name(command.scene);
    check_scene_name(stored_scene_path(command.output, command.scene));
    const ThreadLimit limit(command.run.threads);
    OuterSeconds outer;
    const auto start = Clock::now();
    auto time = start;
    const Scene scene = load_scene(command.scene);
    outer.load = lap(time);
    if (const std::string line = scene.summary.line(); !line.empty() && !command.run.quiet)
        std::fprintf(stderr, "%s: %s\n", command.scene.c_str(), line.c_str());
    const Surface surface(scene);
    outer.tree = lap(time);
    const Json options = options_json(command);
    const TransferProvenance asked = {AFTERGLOW_VERSION, command.scene, scene.content_hash(),
                                      command.options.seed, options.dump()};
    std::optional<Checkpoint> checkpoint;
    std::optional<AtEarlyEnd> advice;
    if (!command.checkpoint.empty()) {
        open_checkpoint(command, asked, checkpoint);
        command.options.checkpoint = &*checkpoint;
        advice.emplace([] {}, "the same command goes on from " + command.checkpoint);
    }

    PrecomputeReport report;
    TuningReport tuning;
    std::optional<Verifier> verifier;
    Verification verified;
    const TransferOperator transfer =
        command.tuned ? tuned_transfer(command, surface, report, tuning, verifier, outer.verification)
                      : plain_transfer(command, surface, report);
    lap(time);
    if (!command.no_verification) {
        if (command.tuned) {
            verified.error = tuning.steps.back().judged.value();
        } else {
            verifier.emplace(fresh_verifier(surface, report, command.options.seed));
            verified.error = verifier->error_of(transfer);
        }
        if (verified.error.any() && transfer.kind == OperatorKind::neumann)
            verified.parts = verifier->parts_of(transfer, {});
    }
    outer.verification += lap(time);
    const LinkCounts links(transfer);
    const Json statistics = statistics_json(transfer, report, links, verified, tuning);
    TransferProvenance provenance = asked;
    provenance.statistics = statistics.dump();
    const std::uint64_t bytes = save_transfer(command.output, transfer, provenance);
    advice.reset();
    if (checkpoint) checkpoint->remove();
    outer.write = lap(time);
    outer.total = std::chrono::duration<double>(time - start).count();

    if (!command.report.empty()) {
        const Json json = {{"version", AFTERGLOW_VERSION},
                           {"scene", command.scene},
                           {"scene_hash", asked.scene_hash},
                           {"triangles", scene.triangles.size()},
                           {"threads", thread_count()},
                           {"options", options},
                           {"statistics", statistics},
                           {"bytes", bytes},
                           {"seconds", seconds_json(report, outer)}};
        write_file(command.report, json.dump(1) + "\n");
    }
    if (command.run.quiet) return;
    print_results(command, transfer, report, links, bytes, verified, outer);
    if (command.tuned) print_tuning(command, tuning);
}

/// Turns what was typed into PrecomputeOptions; throws UsageError for what cannot be.
void fill_options(PrecomputeCommand& command, const CLI::App& sub) {
    const auto given = [&](const char* option) { return sub.count(option) > 0; };
    if (command.operator_name == "paper") {
        if (given("--target-error"))
            throw UsageError("--operator paper knows no --target-error; use --epsilon");
        const PrecomputeOptions paper = PrecomputeOptions::paper();
        command.options.kind = paper.kind;
        command.options.links.threshold = paper.links.threshold;
        if (!given("--sender-levels")) command.options.sender_levels = paper.sender_levels;
        if (!given("--bounces")) command.options.bounces = paper.bounces;
    } else if (command.operator_name != "neumann") {
        throw UsageError("unknown operator '" + command.operator_name
                         + "'; there are neumann and paper");
    }
    if (given("--target-error") && !(command.target_error > 0.0))
        throw UsageError("--target-error must be positive");
    if (given("--max-time") && !(command.max_time > 0.0))
        throw UsageError("--max-time must be positive");
    if (given("--max-memory") && !(command.max_memory > 0.0))
        throw UsageError("--max-memory must be positive");
    const bool limited = given("--max-time") || given("--max-memory");
    if (limited && (given("--coarse-radius") || given("--epsilon") || command.operator_name == "paper"))
        throw UsageError("--max-time and --max-memory limit the search for a spacing; give these or "
                         "--coarse-radius, --epsilon and --operator paper");
    if (given("--checkpoint") && limited)
        throw UsageError("--checkpoint promises the bytes of a run that is not disturbed; with --max-time and "
                         "--max-memory they depend on the run");
    if (given("--checkpoint") && command.operator_name == "paper")
        throw UsageError("--operator paper is made in one go; it knows no --checkpoint");
    if (given("--checkpoint-every") && !(command.checkpoint_every >= 0.0))
        throw UsageError("--checkpoint-every must not be negative");
    command.tuned = limited || (given("--target-error") && !given("--coarse-radius"));
    if (command.draft && (command.tuned || given("--coarse-radius")))
        throw UsageError("--draft chooses the spacing itself");
    if (given("--epsilon") && !(command.epsilon >= 0.0))
        throw UsageError("--epsilon must not be negative");
    if (given("--coarse-radius") && !(command.coarse_radius > 0.0))
        throw UsageError("--coarse-radius must be positive");
    PrecomputeOptions& options = command.options;
    options.seed = command.run.seed;
    options.coarse_radius = static_cast<float>(command.coarse_radius);
    if (given("--epsilon")) options.links.threshold = static_cast<float>(command.epsilon);
    options.links.target_error = command.target_error;
    if (command.draft) {
        options.coarse_scale = draft_scale;
        command.no_verification = true;
    }
    options.links.rays = std::max(16, static_cast<int>(std::bit_ceil(
                                          static_cast<unsigned>(options.links.rays))));
    check(options);
}

} // namespace

void add_precompute_command(CLI::App& app) {
    CLI::App* sub =
        app.add_subcommand("precompute", "Computes the transfer file of a scene: the slow step");
    const auto command = std::make_shared<PrecomputeCommand>();
    sub->add_option("scene", command->scene, "Wavefront OBJ file or builtin:NAME")->required()->type_name("SCENE");
    sub->add_option("-o,--output", command->output, "Transfer file")->required()->type_name("FILE");
    CLI::Option* target_error =
        add_number(*sub, "--target-error", command->target_error,
                   "Relative error of the indirect irradiance to aim at: the spacing follows, by steps "
                   "that are compared with the path tracer (default: the usual spacing, in one step); with "
                   "--coarse-radius, what dropped links may make");
    add_number(*sub, "--max-time", command->max_time,
               "Seconds that --target-error (default 0.1) may take: the best that is reached by then");
    add_number(*sub, "--max-memory", command->max_memory, "Gigabytes that it may take");
    sub->add_flag("--draft", command->draft, "A preview in seconds: wide spacing, few rays, not verified");
    add_number(*sub, "--epsilon", command->epsilon,
               "Instead: links below this are dropped, weighted by the spacings at both ends; of --operator paper "
               "by their size alone (default there 0.025/pi)")
        ->excludes(target_error);
    sub->add_option("--operator", command->operator_name,
                    "neumann: one bounce, repeated at run time (default); paper: several bounces, "
                    "stored, as Lehtinen et al. printed it")
        ->type_name("neumann|paper");
    sub->add_option_function<std::string>(
           "--viewpoint",
           [command](const std::string& text) {
               command->options.viewpoint = parse_numbers("--viewpoint", text, 3);
           },
           "Where the scene is looked at from (default: found by itself)")
        ->type_name("x,y,z");
    add_number(*sub, "--coarse-radius", command->coarse_radius,
               "Distance between the coarsest points (default: 1.28 times the typical distance "
               "between surfaces, less where there are few of them); halves from level to level");
    sub->add_option("--receiver-levels", command->options.receiver_levels,
                    "Levels of receivers, each twice as fine as the one before (default 6)");
    sub->add_option("--sender-levels", command->options.sender_levels,
                    "Levels of senders, spaced alike (default 5; of --operator paper 3)");
    sub->add_option("--rays", command->options.links.rays,
                    "Gather rays of a receiver, made a power of two (default 512): more on coarser levels, on "
                    "the finest no more than its thresholds need, fewer where --target-error or --draft takes "
                    "a wider spacing than usual")
        ->check(CLI::Range(1, 32768));
    sub->add_option("--bounces", command->options.bounces,
                    "Bounces of indirect light (default 0: all; of --operator paper 4)")
        ->check(CLI::Range(0, most_bounces));
    sub->add_flag("--no-verification", command->no_verification,
                  "Do not compare with the path tracer in the end");
    CLI::Option* checkpoint =
        sub->add_option("--checkpoint", command->checkpoint,
                        "File that keeps what is done until all is: after a kill the same command goes on "
                        "from there, to the same bytes")
            ->type_name("FILE");
    add_number(*sub, "--checkpoint-every", command->checkpoint_every,
               "Seconds between two checkpoints (default 10), more where they cost over a hundredth of the time; "
               "0: whenever there is something new")
        ->needs(checkpoint);
    sub->add_option("--report", command->report, "JSON file for counts and times")->type_name("FILE");
    add_run_options(*sub, command->run);
    add_seed_option(*sub, command->run);
    sub->callback([sub, command] {
        fill_options(*command, *sub);
        run(*command);
    });
}

} // namespace afterglow
