#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// `afterglow compare A B`: how far A is from the reference B.
void add_compare_command(CLI::App& app);

} // namespace afterglow
