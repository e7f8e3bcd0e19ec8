#pragma once

#include "core/surface.h"
#include "transport/display.h"
#include "transport/transfer_file.h"

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
          transport(file.transfer, surface), display(file.transfer, surface) {}
    TransferScene(const TransferScene&) = delete; // the members refer to each other
    TransferScene& operator=(const TransferScene&) = delete;
};

/// Names on stderr, in one line, the files that the scene took from outside its folder; nothing where
/// there are none. For programs that open a transfer file: what else was mended, precompute told.
void tell_of_outside_files(const Scene& scene);

} // namespace afterglow
