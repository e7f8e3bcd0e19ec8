#include "core/error.h"
#include "transport/command_chart.h"
#include "transport/command_compare.h"
#include "transport/command_info.h"
#include "transport/command_precompute.h"
#include "transport/command_query.h"
#include "transport/command_reference.h"
#include "transport/command_render.h"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>

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

    const auto fail = [](const std::exception& error, int status, const char* remedy = "") {
        std::fprintf(stderr, "afterglow: %s%s\n", error.what(), remedy);
        return status;
    };
    try {
        app.parse(argc, argv);
        return 0;
    } catch (const CLI::Success& help) {
        return app.exit(help);
    } catch (const CLI::ParseError& error) {
        return fail(error, 2, "; see --help");
    } catch (const afterglow::UsageError& error) {
        return fail(error, 2);
    } catch (const std::exception& error) {
        return fail(error, 1);
    }
}
