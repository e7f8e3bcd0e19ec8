#pragma once

#include "core/surface.h"
#include "transport/precompute.h"
#include "transport/transfer_file.h"

namespace afterglow {

inline PrecomputeOptions small_options() {
    PrecomputeOptions options;
    options.coarse_radius = 0.4f;
    options.receiver_levels = 3;
    options.sender_levels = 2;
    options.links.rays = 64;
    return options;
}

/// The Cornell box by a few hundred points: a second's work, all parts of a file are there.
struct SmallTransfer {
    Scene scene = load_scene("builtin:cornell");
    Surface surface{scene};
    TransferOperator transfer = precompute(surface, small_options());
    TransferProvenance provenance = {
        AFTERGLOW_VERSION, scene.name, scene.content_hash(), 1, "{\"operator\":\"neumann\"}", "{}"};
};

inline const SmallTransfer& small_transfer() {
    static const SmallTransfer small;
    return small;
}

} // namespace afterglow
