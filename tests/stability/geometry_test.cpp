#include "core/builtin_scenes.h"
#include "tests/stability/comparison.h"
#include "tests/stability/scenes.h"
#include "tests/support/surface_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

// What is promised of hard shapes at default settings.

namespace afterglow {
namespace {

TEST(TwoRoomsWithADoor, AreWithinThreePercentAndTheDarkOneWithinFiveOfItsOwnMean) {
    LitScene lit = two_rooms(0.05f, 0.9f);
    const Precomputed rooms(std::move(lit.scene));
    const Comparison seen =
        compare(rooms, lit.light, points_in_sight(rooms.surface(), {2.0f, 1.4f, 2.0f}, 400, 1));
    EXPECT_LT(seen.reference_error(), 0.03); // or it would show nothing
    EXPECT_LE(seen.rel_rmse(), 0.03);
    std::vector<SurfacePoint> places =
        points_in_sight(rooms.surface(), {6.05f, 1.4f, 2.0f}, 400, 2);
    std::erase_if(places, [](const SurfacePoint& x) { return x.position.x() < 4.0499f; });
    const Comparison dark = compare(rooms, lit.light, places, 0.03);
    EXPECT_LT(dark.reference_error(), 0.05);
    EXPECT_LE(dark.rel_rmse(), 0.05);
}

class Gap : public testing::TestWithParam<std::pair<float, double>> {};

TEST_P(Gap, UnderASheetIsLitAsThePathTracerSays) {
    const auto [distance, promised] = GetParam();
    LitScene lit = sheet_above_floor(1.0f, distance);
    const Precomputed room(std::move(lit.scene));
    std::vector<SurfacePoint> covered;
    for (const Quad& quad : covered_by_sheet(1.0f, distance))
        for (const SurfacePoint& x : places_on(quad, 200, covered.size())) covered.push_back(x);
    const Comparison both = compare(room, lit.light, covered, 0.03);
    EXPECT_LT(both.reference_error(), promised);
    EXPECT_LE(both.rel_rmse(), promised);
    EXPECT_LE(std::abs(both.bias()), 0.05);
}

INSTANTIATE_TEST_SUITE_P(Widths, Gap, testing::Values(std::pair(0.1f, 0.1), std::pair(0.01f, 0.2)));

class Furnace : public testing::TestWithParam<std::pair<double, double>> {};

/// A closed box whose indirect light is, in the mean over its six faces of 4 m^2, rho / (1 - rho)
/// times the direct light.
TEST_P(Furnace, MeanIsWithinThePromiseOfTheClosedForm) {
    const auto [rho, promised] = GetParam();
    const Precomputed box(make_builtin_scene("builtin:furnace:" + std::to_string(rho)));
    const Spotlight light{
        .position = Vec3(-0.3f, 0.4f, 0.1f), .inner_angle = 180.0f, .outer_angle = 180.0f};
    const double exact = rho / (1.0 - rho) * 4.0 * EIGEN_PI / 24.0;
    const double mean =
        box.indirect(light, points_by_area(box.scene(), 20000, 3)).cast<double>().mean();
    EXPECT_NEAR(mean / exact, 1.0, promised);
}

std::string furnace_name(const testing::TestParamInfo<Furnace::ParamType>& furnace) {
    return std::to_string(std::lround(100.0 * furnace.param.first));
}

INSTANTIATE_TEST_SUITE_P(Reflectances, Furnace,
                         testing::Values(std::pair(0.95, 0.01), std::pair(0.99, 0.03)),
                         furnace_name);

TEST(BlackFurnace, HasNoIndirectLight) {
    const Precomputed box(make_builtin_scene("builtin:furnace:0"));
    const Spotlight light{.inner_angle = 180.0f, .outer_angle = 180.0f};
    EXPECT_EQ(box.indirect(light, points_by_area(box.scene(), 1000, 3)).maxCoeff(), 0.0f);
}

} // namespace
} // namespace afterglow
