#include "tests/statistics/knobs.h"
#include "tests/statistics/pictures.h"
#include "tests/statistics/put_in.h"
#include "tests/support/statistics.h"

#include <gtest/gtest.h>

#include <tuple>
#include <vector>

// Welch's test between runs of the path tracer with different seeds: a run's mean over all places is
// one value of a sample, so that nothing the path tracer says of its own error is used.
//
// 192 places of 128 paths know a run's mean to about 0.8 %, two samples of 16 runs differ by
// 0.8 % sqrt(2 / 16) = 0.3 % where nothing is wrong. An error of 2 % is seven times that, and the six
// comparisons that are one family with Sidak's correction reject from 3.5 times on.

namespace afterglow {
namespace {

constexpr int runs = 16;

struct Strategies {
    const char* name;
    PathStrategy first, second;
};
void PrintTo(const Strategies& compared, std::ostream* out) {
    *out << compared.name;
}
constexpr Strategies strategies_compared[] = {
    {"PlainPaths", PathStrategy::plain, PathStrategy::plain},
    {"ConnectedPaths", PathStrategy::connected, PathStrategy::connected},
    {"PlainAndConnectedPaths", PathStrategy::plain, PathStrategy::connected}};

/// What the camera sees through the centres of its pixels.
std::vector<SurfacePoint> places_in(const PictureSetting& setting, const Surface& surface) {
    std::vector<SurfacePoint> places;
    for (int y = 0; y < setting.camera.height; ++y)
        for (int x = 0; x < setting.camera.width; ++x) {
            const Vec3 direction = setting.camera.direction(static_cast<float>(x) + 0.5f,
                                                            static_cast<float>(y) + 0.5f);
            if (const Hit hit = surface.closest_hit({setting.camera.position, direction}))
                places.push_back(surface.point(hit));
        }
    return places;
}

/// Mean indirect irradiance over the places, of one run a seed [W/m^2].
std::vector<double> means_of_seeds(const PictureSetting& setting, PathStrategy strategy, Fault fault,
                                   std::uint64_t seeds) {
    const Scene scene = with_fault(setting.scene(), fault, put_in());
    const Surface surface(scene);
    const Spotlight light = with_fault(setting.light, fault, put_in());
    const std::vector<SurfacePoint> places = places_in(setting, surface);
    std::vector<double> means;
    for (std::uint64_t run = 0; run < runs; ++run)
        means.push_back(estimate_irradiance(surface, {&light, 1}, places,
                                            {.samples = 128,
                                             .batches = 2,
                                             .seed = test_seed(seeds + run),
                                             .strategy = strategy})
                            .indirect.cast<double>()
                            .mean());
    return means;
}

class Seeds : public testing::TestWithParam<std::tuple<PictureSetting, Strategies>> {
protected:
    double level = sidak_level(family_level, picture_settings().size() * std::size(strategies_compared));

    static double p_value(Fault fault) {
        const auto& [setting, compared] = GetParam();
        const std::vector<double> first = means_of_seeds(setting, compared.first, Fault::none, 1000);
        const std::vector<double> second = means_of_seeds(setting, compared.second, fault, 2000);
        const Welch test = welch_test(first, second);
        RecordProperty("p_value", std::to_string(test.p_value));
        return test.p_value;
    }
};

TEST_P(Seeds, HaveTheSameMean) {
    EXPECT_GT(p_value(Fault::none), level);
}

TEST_P(Seeds, AreRejectedUnderABrighterLight) {
    EXPECT_LT(p_value(Fault::bright_light), level);
}

TEST_P(Seeds, AreRejectedWithBrighterWalls) {
    EXPECT_LT(p_value(Fault::bright_walls), level);
}

INSTANTIATE_TEST_SUITE_P(
    Of, Seeds, testing::Combine(testing::ValuesIn(picture_settings()), testing::ValuesIn(strategies_compared)),
    [](const auto& compared) {
        return std::get<0>(compared.param).name + "_" + std::get<1>(compared.param).name;
    });

} // namespace
} // namespace afterglow
