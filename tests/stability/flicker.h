#pragma once

#include "core/camera.h"
#include "transport/path_tracer.h"
#include "transport/transfer_operator.h"

#include <span>

namespace afterglow {

/// How much more a picture changes from frame to frame, under a light that moves and that MovingLight
/// follows, than the truth does. Looked at are the means of indirect radiance over blocks of 16 x 16 pixels; a change of a
/// block is relative to the block's true mean over the frames.
struct Flicker {
    double rms = 0.0;     // of the change beyond the reference's, over blocks and frames
    double p95 = 0.0;     // 95 % of its sizes are not above
    double largest = 0.0; // of its sizes
    double noise = 0.0;   // root mean square standard error of the reference's changes
    double change = 0.0;  // rms of the reference's own changes
    double jump_ratio = 0.0; // largest change of a block over the reference's largest, worst block
    /// Root mean square without the reference's noise.
    double net_rms() const;
};

struct FlickerOptions {
    int runs = 4;               // of the reference, from whose spread `noise` comes
    Index samples_per_run = 32; // paths a pixel
    std::uint64_t seed = 1;
};

/// All that the camera sees are surfaces; its picture is a multiple of 16 wide and high. frames:
/// one light each. The reference sends the same paths in all frames, so that most of its noise
/// cancels in a change.
Flicker measure_flicker(const Surface& surface, const TransferOperator& transfer,
                        std::span<const Spotlight> frames, const Camera& camera,
                        const FlickerOptions& options = {});

} // namespace afterglow
