#include "transport/command_chart.h"
#include "transport/command_compare.h"
#include "transport/command_info.h"
#include "transport/command_precompute.h"
#include "transport/command_query.h"
#include "transport/command_reference.h"
#include "transport/command_render.h"
#include "transport/manual.h"
#include "transport/processor.h"
#include "transport/program.h"

#include <CLI/CLI.hpp>

namespace {

const afterglow::ManualText manual = {
    .description =
        "Computes the indirect light of a static scene ahead of time, so that it can be had in an instant for any "
        "light and from any viewpoint: precompute makes the transfer file of a scene, render and query take the "
        "light from it. reference, compare and chart say how far the result is from the truth.\n\n"
        "Results go to standard output or to the files named, progress and errors to standard error. Files appear "
        "whole or not at all. The same input, options and seed give the same bytes on any number of threads, but where "
        "--max-time or --max-memory decides.",
    .see_also = "afterglow-view(1)"};

} // namespace

int main(int argc, char** argv) {
    afterglow::run_faster_twin(argv);
    CLI::App app("Precomputed direct-to-indirect light transport", "afterglow");
    app.set_version_flag("--version", AFTERGLOW_VERSION);
    afterglow::add_manual_options(app, manual);
    app.require_subcommand(0, 1); // an unknown one is told as what was not expected
    afterglow::add_precompute_command(app);
    afterglow::add_render_command(app);
    afterglow::add_query_command(app);
    afterglow::add_info_command(app);
    afterglow::add_reference_command(app);
    afterglow::add_compare_command(app);
    afterglow::add_chart_command(app);
    return afterglow::run_program(app, argc, argv, [&] {
        if (app.get_subcommands().empty()) throw CLI::RequiredError("A subcommand");
    });
}
