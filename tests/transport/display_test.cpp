#include "core/builtin_scenes.h"
#include "tests/support/small_transfer.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace afterglow {
namespace {

struct DisplayExample {
    Scene scene;
    Surface surface;
    TransferOperator transfer;

    explicit DisplayExample(const std::string& name)
        : scene(make_builtin_scene(name)), surface(scene),
          transfer(precompute(surface, medium_options())) {}
};

TEST(Display, CoversAllThatIsInSightAndIsNeverNegative) {
    for (const char* name : {"builtin:cornell", "builtin:furnace", "builtin:two_rooms"}) {
        const DisplayExample example(name);
        const Display display(example.transfer, example.surface);
        Spotlight light{.position = *example.scene.viewpoint,
                        .direction = Vec3(0.3f, -0.5f, 1.0f),
                        .inner_angle = 15.0f,
                        .outer_angle = 30.0f};
        light.check();
        const VectorIrradiance field =
            LightTransport(example.transfer, example.surface).indirect(light);
        int uncovered = 0, black = 0, all = 0;
        for (const SurfacePoint& x :
             points_in_sight(example.surface, *example.scene.viewpoint, 5000, 3)) {
            bool covered = false;
            const Rgb e = display.net_irradiance(x, field, covered).max(0.0f);
            EXPECT_TRUE((e >= 0.0f).all() && e.isFinite().all());
            ++all;
            uncovered += !covered;
            black += (e == 0.0f).all();
        }
        EXPECT_EQ(uncovered, 0) << name;
        // Negative vector irradiance was cut off there.
        EXPECT_LT(black, 0.01 * all) << name;
    }
}

TEST(Display, IsTheBasisTimesTheFieldDottedWithTheNormal) {
    const DisplayExample example("builtin:cornell");
    const Display display(example.transfer, example.surface);
    const PointHierarchy& points = example.transfer.points;
    // A field that is (1, 2, 3) per colour in y, and nothing else: E = max(0, n_y) (1, 2, 3).
    VectorIrradiance field(9 * points.size(), 0.0f);
    for (std::uint32_t i = 0; i < points.size(); ++i)
        for (int c = 0; c < 3; ++c)
            field[9 * i + 3 + c] = static_cast<float>(c + 1);
    for (const SurfacePoint& x : points_by_area(example.scene, 500, 4)) {
        bool covered = false;
        const Rgb e = display.net_irradiance(x, field, covered).max(0.0f);
        if (!covered) continue;
        const Rgb expected = std::max(0.0f, x.normal.y()) * Rgb(1.0f, 2.0f, 3.0f);
        EXPECT_LT((e - expected).abs().maxCoeff(), 1e-4f) << x.normal.transpose();
    }
}

TEST(Display, ReadsTheFinestLevelAlone) {
    const DisplayExample example("builtin:cornell");
    const Display display(example.transfer, example.surface);
    const PointHierarchy& points = example.transfer.points;
    VectorIrradiance field(9 * points.size(), 0.0f);
    for (std::size_t k = 0; k < 9 * points.begin(points.levels() - 1); ++k)
        field[k] = 1e6f;
    for (const SurfacePoint& x : points_by_area(example.scene, 500, 5)) {
        bool covered = false;
        EXPECT_TRUE((display.net_irradiance(x, field, covered).max(0.0f) == 0.0f).all());
    }
}

TEST(Display, IsBlackWhereNothingCovers) {
    // Seen from behind, the floor of a closed room has no functions.
    const DisplayExample example("builtin:furnace");
    const Display display(example.transfer, example.surface);
    const VectorIrradiance field(9 * example.transfer.points.size(), 1.0f);
    bool covered = true;
    const Rgb e = display.net_irradiance({Vec3(0, -1, 0), -Vec3::UnitY()}, field, covered).max(0.0f);
    EXPECT_FALSE(covered);
    EXPECT_TRUE((e == 0.0f).all());
}

} // namespace
} // namespace afterglow
