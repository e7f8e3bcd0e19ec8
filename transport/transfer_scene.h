#pragma once

#include "core/surface.h"
#include "transport/display.h"
#include "transport/transfer_file.h"

#include <cstdio>
#include <string>

namespace afterglow {

/// A transfer file with the scene it was made from, ready to be lit and looked at: what every
/// command that shows something opens.
struct TransferScene {
    const TransferFile file;
    const Scene scene;
    const Surface surface;
    const LightTransport transport;
    const Display display;

    /// Errors as of load_transfer() and load_transfer_scene().
    explicit TransferScene(const std::string& path, const std::string& scene_override = "")
        : file(load_transfer(path)),
          scene(load_transfer_scene(path, file.provenance, scene_override)), surface(scene),
          transport(file.transfer), display(file.transfer, surface) {}
    TransferScene(const TransferScene&) = delete; // the members refer to each other
    TransferScene& operator=(const TransferScene&) = delete;
};

/// Says so on stderr where a light falls on so few senders that its indirect light cannot be trusted.
inline void warn_of_coarse_light(const NeumannStatistics& statistics) {
    if (statistics.lit_senders < fewest_lit_senders)
        std::fprintf(stderr,
                     "afterglow: warning: the light falls on %u points of the finest senders only; "
                     "its indirect light is not to be trusted\n",
                     statistics.lit_senders);
}

} // namespace afterglow
