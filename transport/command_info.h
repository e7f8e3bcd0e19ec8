#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// `afterglow info`: what a transfer file holds.
void add_info_command(CLI::App& app);

} // namespace afterglow
