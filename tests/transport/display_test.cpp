#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/support/quad.h"
#include "tests/support/small_transfer.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"
#include "transport/path_tracer.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

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
            const Rgb e = display.irradiance(x, x.normal, field, light, covered);
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

TEST(Display, TakesNoLightFromBelowTheSurfaceUnderANormalMap) {
    // In a slot of 3 cm over the floor, with a normal that leans by 75 degrees towards its mouth.
    Scene scene = make_builtin_scene("builtin:furnace:0.5");
    add_quad(scene, {Vec3(-1, -0.97f, -1), Vec3(0, -0.97f, -1), Vec3(0, -0.97f, 1), Vec3(-1, -0.97f, 1)});
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, medium_options());
    const Display display(transfer, surface);
    Spotlight light{.position = {0.5f, 0.5f, 0.0f}, .direction = {0.2f, -1.0f, 0.1f}, .inner_angle = 30.0f, .outer_angle = 40.0f};
    light.check();
    const VectorIrradiance field = LightTransport(transfer, surface).indirect(light);
    const float lean = 75.0f * static_cast<float>(EIGEN_PI / 180.0);
    const SurfacePoint x{{-0.05f, -1.0f, 0.1f}, Vec3::UnitY()};
    const Vec3 shown(std::sin(lean), std::cos(lean), 0.0f);
    bool covered = false;
    const Rgb found = display.irradiance(x, shown, field, light, covered, 4096);
    ASSERT_FALSE(((display.irradiance(x, shown, field, light, covered, 0) - found).abs() < 1e-6f).all()) << "not in a gap";

    // The oracle: the radiosity of all that is seen above the surface, by the path tracer.
    constexpr Index directions = 4096;
    std::vector<SurfacePoint> seen;
    std::vector<Rgb> reflectance;
    for (Index k = 0; k < directions; ++k) {
        const Vec3 direction = Frame(shown).to_world(sample_cosine(scrambled_sobol2(static_cast<std::uint32_t>(k), 99)));
        if (direction.dot(x.normal) <= 0.0f) continue;
        const Hit hit = surface.closest_hit({surface.lifted(x), direction});
        ASSERT_TRUE(hit);
        seen.push_back(surface.point(hit));
        reflectance.push_back(surface.reflectance(hit));
    }
    const IrradianceEstimate of_seen = estimate_irradiance(surface, {&light, 1}, seen, {.samples = 64});
    Rgb wanted = Rgb::Zero();
    for (std::size_t k = 0; k < seen.size(); ++k)
        wanted += reflectance[k] * (of_seen.direct.col(k) + of_seen.indirect.col(k)) / static_cast<float>(directions);
    EXPECT_NEAR(found.mean() / wanted.mean(), 1.0f, 0.04f);
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
