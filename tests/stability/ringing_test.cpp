#include "core/builtin_scenes.h"
#include "tests/stability/ringing.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

namespace afterglow {
namespace {

// Of dark scenes and of tight spots this does not hold: the families ringing_* of
// afterglow_stability.
TEST(Ringing, IsRareAndSmallUnderALampInBrightRooms) {
    struct Case {
        const char* scene;
        Vec3 eye, lamp;
    };
    for (const Case& c : {Case{"builtin:cornell", {0.278f, 0.273f, 0.03f}, {0.278f, 0.54f, 0.28f}},
                          Case{"builtin:two_rooms", {6.0f, 1.4f, 2.0f}, {2.0f, 2.7f, 2.0f}}}) {
        const Scene scene = make_builtin_scene(c.scene);
        const Surface surface(scene);
        const TransferOperator transfer = precompute(surface, {});
        Spotlight light{.position = c.lamp, .inner_angle = 45.0f, .outer_angle = 45.0f};
        light.check();
        const std::vector<SurfacePoint> places = points_in_sight(surface, c.eye, 4000, 5);
        const Eigen::Array3Xf unclamped = unclamped_irradiance(surface, transfer, light, places);
        const Ringing ringing = ringing_of(unclamped);
        EXPECT_LE(ringing.negative_share, 1e-3) << c.scene;
        EXPECT_LE(ringing.largest, 1e-2) << c.scene;

        // It is what Display clamps.
        const VectorIrradiance field = LightTransport(transfer, surface).indirect(light);
        const Display display(transfer, surface);
        for (std::size_t p = 0; p < places.size(); p += 100) {
            bool covered = false;
            const Rgb clamped = display.irradiance(places[p], places[p].normal, field, light, covered, 0);
            EXPECT_TRUE(clamped.isApprox(unclamped.col(static_cast<Index>(p)).max(0.0f), 1e-4f));
        }
    }
}

} // namespace
} // namespace afterglow
