#include "core/builtin_scenes.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

constexpr double pi = EIGEN_PI;

/// A closed box of two metres with reflectance 1/2 and senders on it.
struct Example {
    Scene scene = make_builtin_scene("builtin:furnace:0.5");
    Surface surface{scene};
    TransferOperator transfer = precompute(surface, options());
    DirectLight direct{transfer.points, transfer.sender_levels - 1, transfer.sender_areas, surface};

    static PrecomputeOptions options() {
        PrecomputeOptions options;
        options.coarse_radius = 0.4f;
        options.receiver_levels = 4;
        options.sender_levels = 3;
        options.links.rays = 64;
        return options;
    }
    float spacing() const { return transfer.points.spacing[transfer.sender_levels - 1]; }
    std::uint32_t begin() const { return transfer.points.begin(transfer.sender_levels - 1); }

    Radiosity radiosity(const Spotlight& light) const {
        Radiosity result(3 * (transfer.senders() - begin()));
        direct.radiosity(light, result);
        return result;
    }
    /// sum_j b_j <B_j, 1> of the green channel [W].
    double power(const Radiosity& radiosity) const {
        double sum = 0.0;
        for (std::size_t j = 0; j < transfer.sender_areas.size(); ++j)
            sum += static_cast<double>(radiosity[3 * j + 1]) * transfer.sender_areas[j];
        return sum;
    }
};

const Example& example() {
    static const Example made;
    return made;
}

Spotlight spot(const Vec3& position, const Vec3& direction, float angle) {
    Spotlight light{.position = position,
                    .direction = direction,
                    .inner_angle = angle,
                    .outer_angle = angle,
                    .intensity = Rgb(3.0f, 2.0f, 1.0f)};
    light.check();
    return light;
}

double flux(const Spotlight& light) {
    return light.intensity[1] * 2.0 * pi * (1.0 - std::cos(light.outer_angle * pi / 180.0));
}

TEST(DirectLight, SharesGoFromSplattedToSampledWithTheWidthOfWhatIsLit) {
    const Spotlight wide = spot(Vec3::Zero(), Vec3::UnitX(), 60.0f);
    EXPECT_EQ(sampled_share(wide, 0.39f, 0.1f), 0.0f);
    EXPECT_NEAR(sampled_share(wide, 0.7f, 0.1f), 0.5f, 1e-5f);
    EXPECT_EQ(sampled_share(wide, 1.01f, 0.1f), 1.0f);
    const Spotlight tight = spot(Vec3::Zero(), Vec3::UnitX(), 2.0f);
    EXPECT_EQ(sampled_share(tight, 10.0f, 0.1f), 0.0f);
    EXPECT_EQ(sampled_share(tight, 29.0f, 0.1f), 1.0f);
}

TEST(DirectLight, LosesNoneOfATightOrCloseLight) {
    // All of it falls on the walls, which send on a half: sum_j b_j <B_j, 1> = rho Phi. (The areas are
    // sums over patches: right to a per cent or two for the few functions of one spot.)
    struct Case {
        Vec3 position, direction;
        float angle;
    };
    for (const Case& c : {Case{{0.1f, 0.7f, -0.1f}, {0.1f, -1.0f, 0.2f}, 0.1f},
                          Case{{0.1f, 0.7f, -0.1f}, {0.1f, -1.0f, 0.2f}, 3.0f},
                          Case{{0.2f, -0.999f, 0.3f}, {0.0f, -1.0f, 0.0f}, 60.0f},
                          Case{{0.2f, -0.9f, 0.3f}, {0.0f, -1.0f, 0.0f}, 80.0f},
                          Case{{-0.98f, 0.97f, 0.99f}, {-1.0f, 1.0f, 1.0f}, 30.0f}}) {
        const Spotlight light = spot(c.position, c.direction, c.angle);
        EXPECT_NEAR(example().power(example().radiosity(light)) / (0.5 * flux(light)), 1.0, 0.03)
            << c.position.transpose() << ", " << c.angle << " degrees";
    }
}

TEST(DirectLight, LosesNoneWhereTheTwoSharesMeet) {
    // Distances of 2 to 14 spacings from the floor, beside which nothing is lit.
    for (const float spacings : {2.0f, 5.0f, 7.0f, 9.0f, 14.0f}) {
        const Spotlight light = spot(Vec3(0.0f, spacings * example().spacing() - 1.0f, 0.0f),
                                     -Vec3::UnitY(), 35.0f);
        EXPECT_NEAR(example().power(example().radiosity(light)) / (0.5 * flux(light)), 1.0, 0.04)
            << spacings << " spacings";
    }
}

TEST(DirectLight, OfAFarLightIsSampledAtThePoints) {
    const Spotlight light = spot(Vec3(0.0f, 0.9f, 0.0f), -Vec3::UnitY(), 40.0f);
    ASSERT_GT(sampled_share(light, 1.9f, example().spacing()), 0.999f);
    const Radiosity radiosity = example().radiosity(light);
    for (std::uint32_t j = 0; j < radiosity.size() / 3; ++j) {
        const SurfacePoint x = example().transfer.points.point(example().begin() + j);
        if (x.position.y() > -0.99f) continue; // on the floor all is far
        const Rgb expected = 0.5f * direct_irradiance(example().surface, light, x);
        EXPECT_TRUE(Rgb::Map(&radiosity[3 * j]).isApprox(expected, 1e-5f));
    }
}

TEST(DirectLight, MovesSmoothly) {
    // A close light in steps of a fiftieth of a spacing: nothing jumps as functions come and go.
    const float step = example().spacing() / 50.0f;
    Radiosity last;
    for (int k = 0; k < 20; ++k) {
        const Spotlight light =
            spot(Vec3(0.1f + static_cast<float>(k) * step, -0.8f, 0.2f), -Vec3::UnitY(), 30.0f);
        const Radiosity now = example().radiosity(light);
        double change = 0.0, sum = 0.0;
        for (std::size_t j = 0; j < last.size(); ++j) {
            change += std::abs(now[j] - last[j]);
            sum += now[j];
        }
        EXPECT_LE(change, 0.05 * sum) << "step " << k;
        last = now;
    }
}

} // namespace
} // namespace afterglow
