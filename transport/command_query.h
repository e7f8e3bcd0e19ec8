#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// `afterglow query`: indirect irradiance at points, from a transfer file.
void add_query_command(CLI::App& app);

} // namespace afterglow
