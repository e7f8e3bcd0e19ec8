#pragma once

namespace CLI {
class App;
}

namespace afterglow {

/// `afterglow render`: a picture from a transfer file, under any light.
void add_render_command(CLI::App& app);

} // namespace afterglow
