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

/// With links enough for thresholds and walls to matter; some seconds' work.
inline PrecomputeOptions medium_options() {
    PrecomputeOptions options;
    options.receiver_levels = 4;
    options.sender_levels = 3;
    options.links.rays = 128;
    return options;
}

inline PrecomputeOptions small_paper_options() {
    PrecomputeOptions options = PrecomputeOptions::paper();
    options.coarse_radius = 0.4f;
    options.receiver_levels = 3;
    options.sender_levels = 2;
    options.links.rays = 64;
    return options;
}

/// The Cornell box by a few hundred points: a second's work, all parts of a file are there.
struct SmallTransfer {
    PrecomputeOptions options;
    Scene scene = load_scene("builtin:cornell");
    Surface surface{scene};
    TransferOperator transfer = precompute(surface, options);
    TransferProvenance provenance = {
        AFTERGLOW_VERSION, scene.name, scene.content_hash(), 1, "{\"seed\":1}", "{}"};
};

inline const SmallTransfer& small_transfer() {
    static const SmallTransfer small{small_options()};
    return small;
}

/// The paper's operator of the same scene.
inline const SmallTransfer& small_paper_transfer() {
    static const SmallTransfer small{small_paper_options()};
    return small;
}

} // namespace afterglow
