#include "transport/command_query.h"

#include "core/parallel.h"
#include "transport/cli_options.h"
#include "transport/csv_points.h"
#include "transport/provenance.h"
#include "transport/transfer_scene.h"

#include <CLI/CLI.hpp>

#include <cstdio>
#include <memory>
#include <span>

namespace afterglow {
namespace {

struct QueryCommand {
    std::string file, scene, points, output;
    Spotlight light;
    RunOptions run;
};

void run(QueryCommand& command) {
    command.light.check();
    check_outputs({command.output}, {command.file, command.points, command.scene});
    const ThreadLimit limit(command.run.threads);
    const TransferScene opened(command.file, command.scene);
    check_outputs({command.output}, {opened.scene.name});
    if (!command.run.quiet) tell_of_outside_files(opened.scene);
    const Spotlight light = command.light.off_surfaces(opened.surface);
    const VectorIrradiance field = opened.transport.indirect(light);
    Index uncovered = 0;
    std::size_t count = 0;
    PlacesMoved moved;
    answer_points_csv(command.points, command.output, [&](std::span<SurfacePoint> points) {
        moved += opened.surface.move_onto_surfaces(points);
        Index without = 0;
        const Eigen::Array3Xf irradiance = opened.display.irradiance(points, field, light, &without);
        uncovered += without;
        count += points.size();
        return irradiance;
    });

    if (command.run.quiet) return;
    tell_of_moved_places(moved, count);
    if (uncovered > 0)
        std::fprintf(stderr, "afterglow: warning: no function covers %lld of %lld points\n",
                     static_cast<long long>(uncovered), static_cast<long long>(count));
}

} // namespace

void add_query_command(CLI::App& app) {
    CLI::App* sub =
        app.add_subcommand("query", "Indirect irradiance at points, from a transfer file");
    const auto command = std::make_shared<QueryCommand>();
    sub->add_option("file", command->file, "Transfer file")->required()->type_name("FILE");
    sub->add_option("--points", command->points, "CSV file of x,y,z,nx,ny,nz; /dev/stdin to read them as they come")
        ->required()->type_name("FILE");
    sub->add_option("-o,--output", command->output, "CSV file of E_r,E_g,E_b")->required()->type_name("FILE");
    sub->add_option("--scene", command->scene, "Where the scene is now")->type_name("SCENE");
    add_light_options(*sub, command->light);
    add_run_options(*sub, command->run);
    sub->callback([command] { run(*command); });
}

} // namespace afterglow
