#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// `afterglow precompute`: from a scene to its transfer file.
void add_precompute_command(CLI::App& app);

} // namespace afterglow
