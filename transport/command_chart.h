#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// afterglow chart SCENE... -o DIR: error against time, bytes and each parameter, as figures.
void add_chart_command(CLI::App& app);

} // namespace afterglow
