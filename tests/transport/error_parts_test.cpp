#include "transport/error_parts.h"

#include "core/builtin_scenes.h"
#include "tests/support/small_transfer.h"
#include "transport/precompute.h"
#include "transport/verification.h"

#include <gtest/gtest.h>

namespace afterglow {
namespace {

/// The measured box, and trials in it: of one alone, a single light or place may decide.
struct CornellBox {
    Scene scene = make_builtin_scene("builtin:cornell");
    Surface surface{scene};
    Verifier verifier{surface, find_viewpoints(surface, 1),
                      {.trials = 3, .lights = 3, .places = 125, .reference_error = 0.05, .most_rays = 10'000'000, .seed = 5}};

    ErrorParts parts_of(const PrecomputeOptions& options) const {
        return verifier.parts_of(precompute(surface, options), {.places = 125, .rays = 512});
    }
};

/// Whether one exceeds the other by more than both are uncertain.
void expect_larger(const ErrorPart& larger, const ErrorPart& smaller) {
    EXPECT_GT(larger.rms - 2.0 * larger.standard_error, smaller.rms + 2.0 * smaller.standard_error);
}

TEST(ErrorParts, EachGrowsWithWhatItIsNamedAfter) {
    const CornellBox box;
    PrecomputeOptions options;
    options.coarse_scale = 2.0f;
    const ErrorParts usual = box.parts_of(options);
    EXPECT_TRUE(usual.any());

    PrecomputeOptions few_rays = options; // and no threshold against their noise
    few_rays.links.rays = 16;
    few_rays.links.threshold = 0.0f;
    const ErrorParts noisy = box.parts_of(few_rays);
    expect_larger(noisy.links, usual.links);

    PrecomputeOptions few_senders = options;
    few_senders.sender_levels = 2;
    const ErrorParts coarse = box.parts_of(few_senders);
    expect_larger(coarse.senders, usual.senders);

    PrecomputeOptions few_receivers = options;
    few_receivers.coarse_radius = 0.3f; // of a room of 0.55
    few_receivers.receiver_levels = 2;
    few_receivers.sender_levels = 2;
    few_receivers.links.rays = 8192;
    few_receivers.links.threshold = 0.0f;
    const ErrorParts wide = box.parts_of(few_receivers);

    expect_larger(wide.receivers, usual.receivers);
}

TEST(ErrorParts, KnowsSendersThatRadiateTooLittle) {
    const Scene scene = make_builtin_scene("builtin:furnace:0.5");
    const Surface surface(scene);
    const Verifier verifier(surface, find_viewpoints(surface, 1),
                            {.lights = 3, .places = 300, .reference_error = 0.02, .most_rays = 4'000'000, .seed = 1});
    TransferOperator transfer = precompute(surface, medium_options());
    const ErrorParts good = verifier.parts_of(transfer, {});
    EXPECT_LT(good.senders.rms, 0.1);
    // Walls that reflect 0.4 instead of 0.5: of the first bounce a fifth is missing, of the second more.
    transfer.points.reflectance *= 0.8f;
    const ErrorParts off = verifier.parts_of(transfer, {});
    EXPECT_GT(off.senders.rms - 3.0 * off.senders.standard_error, 0.15);
    EXPECT_LT(off.links.rms, 0.1); // they pass on what is there
}

} // namespace
} // namespace afterglow
