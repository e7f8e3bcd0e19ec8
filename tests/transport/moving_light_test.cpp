#include "transport/moving_light.h"

#include "core/parallel.h"
#include "tests/support/small_transfer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

const SmallTransfer& example() {
    static const SmallTransfer transfer{medium_options()};
    return transfer;
}

const LightTransport& transport() {
    static const LightTransport t(example().transfer, example().surface);
    return t;
}

/// A lamp under the ceiling that walks along x.
Spotlight lamp(float x) {
    Spotlight light{.position = {x, 0.5f, 0.28f}, .direction = {0.0f, -1.0f, 0.1f},
                    .inner_angle = 30.0f, .outer_angle = 50.0f, .intensity = {3.0f, 2.0f, 1.0f}};
    light.check();
    return light;
}

/// Root of the sum of squared differences at the display level, over that of `b`.
double difference(const VectorIrradiance& a, const VectorIrradiance& b) {
    const PointHierarchy& points = example().transfer.points;
    double squares = 0.0, size = 0.0;
    for (std::size_t k = 9 * points.begin(points.levels() - 1); k < b.size(); ++k) {
        squares += std::pow(static_cast<double>(a[k]) - b[k], 2);
        size += std::pow(static_cast<double>(b[k]), 2);
    }
    return std::sqrt(squares / size);
}

// Its tolerance and the solver's that it is compared with, both before what further bounces make of
// them: at most 1 / (1 - 0.75), the largest reflectance here.
const double close = (MovingLight::Options().tolerance + LightTransport::usual_tolerance) / (1.0 - 0.75);

TEST(MovingLight, IsIndirectLightWhereverTheLightGoes) {
    MovingLight moving(transport(), {});
    MovingLightStatistics s;
    const auto expect_close = [&](float x) {
        const VectorIrradiance field = moving.follow(lamp(x), &s);
        EXPECT_TRUE(s.settled);
        EXPECT_LT(difference(field, transport().indirect(lamp(x))), close) << "at " << x;
    };
    expect_close(0.1f);
    EXPECT_TRUE(s.anew);
    double share = 0.0;
    for (int k = 1; k <= 50; ++k) {
        moving.follow(lamp(0.1f + 0.002f * static_cast<float>(k)), &s);
        EXPECT_FALSE(s.anew) << "step " << k;
        share += s.links_share / 50.0;
    }
    EXPECT_LT(share, 1.0);
    expect_close(0.202f);
    expect_close(0.45f);                                  // a jump
    for (int k = 0; k < 5; ++k) expect_close(k % 2 ? 0.45f : 0.1f); // to and fro: errors do not add up
}

TEST(MovingLight, LeavesNoPointBelowZero) {
    // In units of the largest irradiance at a point of the display level, of any colour.
    const auto least = [](const VectorIrradiance& field) {
        const PointHierarchy& points = example().transfer.points;
        float low = 0.0f, high = 0.0f;
        for (Index i = points.begin(points.levels() - 1); i < points.size(); ++i) {
            const Rgb e = net_irradiance(field, i, points.normal.col(i));
            low = std::min(low, e.minCoeff());
            high = std::max(high, e.maxCoeff());
        }
        return low / high;
    };
    Spotlight light = lamp(0.1f); // a spot, whose light changes within a few spacings
    light.inner_angle = light.outer_angle = 5.0f;
    EXPECT_LT(least(transport().gather(transport().radiosity(light))), -1e-3f) << "shows nothing";
    EXPECT_GT(least(transport().indirect(light)), -1e-6f);
    MovingLight moving(transport(), {});
    for (int k = 0; k < 5; ++k) {
        light.position.x() += 0.02f;
        EXPECT_GT(least(moving.follow(light)), -1e-6f) << "pose " << k;
    }
}

TEST(MovingLight, RestsWhenTheLightRests) {
    MovingLight moving(transport(), {});
    moving.follow(lamp(0.2f));
    MovingLightStatistics s;
    const VectorIrradiance once = moving.follow(lamp(0.2f), &s);
    EXPECT_EQ(s.rounds, 1);
    EXPECT_EQ(s.links_share, 0.0);
    EXPECT_EQ(moving.follow(lamp(0.2f)), once);
}

TEST(MovingLight, IsDarkWhenTheLightIsOff) {
    MovingLight moving(transport(), {});
    moving.follow(lamp(0.2f));
    Spotlight off = lamp(0.2f);
    off.intensity.setZero();
    MovingLightStatistics s;
    const VectorIrradiance& field = moving.follow(off, &s);
    EXPECT_TRUE(s.settled);
    EXPECT_TRUE(std::all_of(field.begin(), field.end(), [](float v) { return v == 0.0f; }));
    // And light again.
    EXPECT_LT(difference(moving.follow(lamp(0.2f)), transport().indirect(lamp(0.2f))), close);
}

TEST(MovingLight, IsAsCloseWhereTheLightHasGoneFarAway) {
    MovingLight moving(transport(), {});
    // In front of the box, farther with every step: a thousandth of the light is left.
    for (float z = 0.0f; z > -20.0f; z = 1.2f * z - 0.05f) {
        Spotlight light = lamp(0.278f);
        light.position = {0.278f, 0.3f, z};
        light.direction = Vec3::UnitZ();
        EXPECT_LT(difference(moving.follow(light), transport().indirect(light)), close) << "at " << z;
    }
}

TEST(MovingLight, FollowsABrighterLight) {
    MovingLight moving(transport(), {});
    moving.follow(lamp(0.2f));
    for (const float factor : {1.1f, 100.0f, 0.01f}) {
        Spotlight light = lamp(0.2f);
        light.intensity *= Rgb(factor, 1.0f, factor);
        EXPECT_LT(difference(moving.follow(light), transport().indirect(light)), close) << factor;
    }
}

TEST(MovingLight, ComesCloserRoundByRound) {
    MovingLight moving(transport(), {.most_rounds = 1});
    const VectorIrradiance expected = transport().indirect(lamp(0.35f));
    moving.follow(lamp(0.3f));
    double last = difference(moving.follow(lamp(0.35f)), expected);
    EXPECT_LT(last, 0.5);
    MovingLightStatistics s;
    for (int k = 0; k < 20 && !s.settled; ++k) moving.follow(lamp(0.35f), &s);
    EXPECT_TRUE(s.settled);
    EXPECT_LT(difference(moving.follow(lamp(0.35f)), expected), close);
}

TEST(MovingLight, EndsWhereItsRoundsDoNotConverge) {
    TransferOperator gaining = example().transfer;
    gaining.points.reflectance.setConstant(4.0f);
    const LightTransport t(gaining, example().surface);
    MovingLight moving(t, {});
    MovingLightStatistics s;
    moving.follow(lamp(0.2f), &s);
    moving.follow(lamp(0.2002f), &s);
    EXPECT_TRUE(s.settled && s.anew);
    MovingLight by_rounds(t, {.most_rounds = 1}); // as a window asks
    by_rounds.follow(lamp(0.2f), &s);
    int rounds = 0;
    do by_rounds.follow(lamp(0.2002f), &s);
    while (!s.settled && ++rounds < 1000);
    EXPECT_LT(rounds, 100);
}

TEST(MovingLight, FollowsALightTooStrongToSquare) {
    MovingLight moving(transport(), {});
    for (const float x : {0.2f, 0.21f}) {
        Spotlight light = lamp(x);
        light.intensity *= 1e22f;
        const VectorIrradiance expected = transport().indirect(light);
        EXPECT_LT(difference(moving.follow(light), expected), close) << x;
    }
}

TEST(MovingLight, IsTheSameAtAnyNumberOfThreads) {
    const auto field = [](int threads) {
        const ThreadLimit limit(threads);
        MovingLight moving(transport(), {});
        moving.follow(lamp(0.1f));
        moving.follow(lamp(0.11f));
        return moving.follow(lamp(0.14f));
    };
    EXPECT_EQ(field(1), field(2));
}

TEST(MovingLight, OfThePapersOperatorIsItsIndirectLight) {
    const SmallTransfer& small = small_paper_transfer();
    const LightTransport paper(small.transfer, small.surface);
    MovingLight moving(paper, {});
    EXPECT_EQ(moving.follow(lamp(0.2f)), paper.indirect(lamp(0.2f)));
}

} // namespace
} // namespace afterglow
