#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// `afterglow reference`: indirect irradiance at points, or a picture, by path tracing.
void add_reference_command(CLI::App& app);

} // namespace afterglow
