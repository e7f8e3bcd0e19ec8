#include "transport/command_chart.h"
#include "transport/command_compare.h"
#include "transport/command_info.h"
#include "transport/command_precompute.h"
#include "transport/command_query.h"
#include "transport/command_reference.h"
#include "transport/command_render.h"
#include "transport/program.h"

#include <CLI/CLI.hpp>

int main(int argc, char** argv) {
    CLI::App app("Precomputed direct-to-indirect light transport", "afterglow");
    app.set_version_flag("--version", AFTERGLOW_VERSION);
    app.require_subcommand(1);
    afterglow::add_precompute_command(app);
    afterglow::add_render_command(app);
    afterglow::add_query_command(app);
    afterglow::add_info_command(app);
    afterglow::add_reference_command(app);
    afterglow::add_compare_command(app);
    afterglow::add_chart_command(app);
    return afterglow::run_program(app, argc, argv);
}
