#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/sampling.h"
#include "transport/spotlight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace afterglow {
namespace {

float cosine(float degrees) {
    return std::cos(degrees * static_cast<float>(EIGEN_PI) / 180.0f);
}

TEST(Spotlight, FalloffIsTheSquaredRampOfGltf) {
    const Spotlight light{.inner_angle = 20.0f, .outer_angle = 40.0f};
    EXPECT_EQ(light.falloff(1.0f), 1.0f);
    EXPECT_EQ(light.falloff(cosine(19.9f)), 1.0f);
    EXPECT_EQ(light.falloff(cosine(40.1f)), 0.0f);
    EXPECT_EQ(light.falloff(-1.0f), 0.0f);
    for (float angle = 21.0f; angle < 40.0f; angle += 1.0f) {
        const float ramp = (cosine(angle) - cosine(40.0f)) / (cosine(20.0f) - cosine(40.0f));
        EXPECT_NEAR(light.falloff(cosine(angle)), ramp * ramp, 1e-5f) << angle << " degrees";
    }
}

TEST(Spotlight, NarrowRampIsAsWideAsGltfBoundsIt) {
    const Spotlight light{.inner_angle = 29.999f, .outer_angle = 30.0f};
    // Half of the bound .001 above the cosine of the outer angle: (1/2)^2.
    EXPECT_NEAR(light.falloff(cosine(30.0f) + 0.0005f), 0.25f, 1e-3f);
    EXPECT_EQ(light.falloff(cosine(30.0f) + 0.0011f), 1.0f);
}

TEST(Spotlight, EqualAnglesMakeAHardCone) {
    const Spotlight light{.inner_angle = 30.0f, .outer_angle = 30.0f};
    EXPECT_EQ(light.falloff(cosine(29.99f)), 1.0f);
    EXPECT_EQ(light.falloff(cosine(30.01f)), 0.0f);
    const Spotlight everywhere{.inner_angle = 180.0f, .outer_angle = 180.0f};
    EXPECT_EQ(everywhere.falloff(-1.0f), 1.0f);
}

TEST(Spotlight, IrradianceOnAPlaneIsIntensityTimesFalloffTimesCosineOverSquaredDistance) {
    Spotlight light{.position = Vec3(0.3f, 2.0f, -0.4f),
                    .direction = Vec3(0.2f, -1.0f, 0.1f),
                    .inner_angle = 15.0f,
                    .outer_angle = 35.0f,
                    .intensity = Rgb(1.0f, 2.0f, 3.0f)};
    light.check();
    const double h = 2.0;
    int lit = 0;
    for (std::uint32_t i = 0; i < 1000; ++i) {
        const Vec2 u = scrambled_sobol2(i, 5);
        const Vec3 p(4.0f * u.x() - 2.0f, 0.0f, 4.0f * u.y() - 2.0f);
        const Eigen::Vector3d to_point = p.cast<double>() - light.position.cast<double>();
        const double r2 = to_point.squaredNorm();
        const double c = to_point.dot(light.direction.cast<double>()) / std::sqrt(r2);
        const double a = std::cos(15.0 * EIGEN_PI / 180.0), b = std::cos(35.0 * EIGEN_PI / 180.0);
        const double t = std::fmin(1.0, std::fmax(0.0, (c - b) / (a - b)));
        const double expected = t * t * (h / std::sqrt(r2)) / r2;
        const Rgb e = unoccluded_irradiance(light, {p, Vec3::UnitY()});
        for (int channel = 0; channel < 3; ++channel)
            EXPECT_NEAR(e[channel], (channel + 1) * expected, 1e-5) << "at " << p.transpose();
        EXPECT_TRUE((unoccluded_irradiance(light, {p, -Vec3::UnitY()}) == 0.0f).all());
        lit += expected > 0.0;
    }
    EXPECT_GT(lit, 100);
    EXPECT_LT(lit, 900);
}

TEST(Spotlight, IsMovedOffTheSurfacesThatItLiesOn) {
    const Scene scene = make_builtin_scene("builtin:furnace"); // from -1 to 1
    const Surface surface(scene);
    const auto moved = [&](const Vec3& position, const Vec3& direction) -> Vec3 {
        return Spotlight{.position = position, .direction = direction}.off_surfaces(surface).position;
    };
    const float lift = surface.lift();
    const Vec3 down = -Vec3::UnitY(), inside(0.2f, 0.9f, 0.3f);
    EXPECT_EQ(moved(inside, down), inside);
    for (const float off : {-1.0f, 0.0f, 1.0f}) { // in the ceiling, within rounding
        const Vec3 lamp = moved(Vec3(0.2f, 1.0f + off * lift, 0.3f), down);
        EXPECT_NEAR(lamp.y(), 1.0f - 3.0f * lift, 0.5f * lift);
        EXPECT_EQ(lamp.x(), 0.2f);
        for (float x = -0.999f; x < 1.0f; x += 0.037f) {
            const SurfacePoint floor{Vec3(x, -1.0f, 0.5f), Vec3::UnitY()};
            EXPECT_FALSE(surface.blocked(surface.lifted(floor), lamp)) << x;
        }
    }
    EXPECT_NEAR(moved(Vec3(1.0f, 0.0f, 0.0f), down).x(), 1.0f - 3.0f * lift, 0.5f * lift) << "along a wall";
    const Vec3 corner = moved(Vec3(1.0f, 1.0f, -1.0f), Vec3(-0.6f, -0.6f, 0.5f).normalized());
    EXPECT_LT((corner - Vec3(1.0f - 3.0f * lift, 1.0f - 3.0f * lift, -1.0f + 3.0f * lift)).cwiseAbs().maxCoeff(), lift);
}

TEST(Spotlight, CheckNormalisesTheDirectionAndRefusesTheImpossible) {
    Spotlight light{.direction = Vec3(0.0f, -3.0f, 4.0f)};
    light.check();
    EXPECT_TRUE(light.direction.isApprox(Vec3(0.0f, -0.6f, 0.8f)));

    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinity = std::numeric_limits<float>::infinity();
    for (Spotlight bad :
         {Spotlight{.direction = Vec3::Zero()}, Spotlight{.position = Vec3(nan, 0.0f, 0.0f)},
          Spotlight{.direction = Vec3(infinity, 0.0f, 0.0f)},
          Spotlight{.inner_angle = 50.0f, .outer_angle = 40.0f},
          Spotlight{.inner_angle = -1.0f, .outer_angle = 40.0f},
          Spotlight{.inner_angle = 0.0f, .outer_angle = 0.0f},
          Spotlight{.inner_angle = 0.0f, .outer_angle = 181.0f},
          Spotlight{.intensity = Rgb(1.0f, -1.0f, 0.0f)},
          Spotlight{.intensity = Rgb(1.0f, nan, 0.0f)}})
        EXPECT_THROW(bad.check(), UsageError);
}

} // namespace
} // namespace afterglow
