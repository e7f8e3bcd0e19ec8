#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "transport/light_vertices.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

namespace afterglow {
namespace {

using std::numbers::pi;

Spotlight cone(float inner, float outer) {
    Spotlight light{
        .direction = Vec3(1.0f, -2.0f, 0.5f), .inner_angle = inner, .outer_angle = outer};
    light.check();
    return light;
}

const std::vector<Spotlight> cones = {cone(0.0f, 45.0f),   cone(30.0f, 35.0f),  cone(29.99f, 30.0f),
                                      cone(30.0f, 30.0f),  cone(1.0f, 2.0f),    cone(2.0f, 2.0f),
                                      cone(60.0f, 170.0f), cone(180.0f, 180.0f)};

TEST(ConeSampler, DensityIntegratesToOne) {
    for (const Spotlight& light : cones) {
        const ConeSampler sampler(light);
        // Over the cosine, finely near the axis: c = 1 - 2 s^4.
        constexpr int steps = 200000;
        double integral = 0.0;
        for (int i = 0; i < steps; ++i) {
            const double s = (i + 0.5) / steps;
            integral += 2.0 * pi * sampler.pdf(static_cast<float>(1.0 - 2.0 * std::pow(s, 4.0)))
                        * 8.0 * std::pow(s, 3.0) / steps;
        }
        EXPECT_NEAR(integral, 1.0, 2e-3) << light.inner_angle << ", " << light.outer_angle;
    }
}

TEST(ConeSampler, DirectionsFollowTheDensity) {
    for (const Spotlight& light : cones) {
        const ConeSampler sampler(light);
        // If c has the density 2 pi pdf(c), then its distribution function maps it to [0, 1)
        // uniformly.
        const double width = 1.0 - std::cos(light.outer_angle * pi / 180.0);
        constexpr int bins = 20, samples = 1 << 16, steps = 2000;
        std::vector<double> measured(bins, 0.0), expected(bins, 0.0);
        for (std::uint32_t i = 0; i < samples; ++i) {
            const Vec3 d = sampler.direction(scrambled_sobol2(i, 3));
            EXPECT_NEAR(d.norm(), 1.0f, 1e-5f);
            const double below =
                (1.0 - d.cast<double>().dot(light.direction.cast<double>())) / width;
            measured[static_cast<std::size_t>(std::clamp(below * bins, 0.0, bins - 1.0))] +=
                1.0 / samples;
        }
        for (int i = 0; i < bins * steps; ++i) {
            const double c = 1.0 - width * (i + 0.5) / (bins * steps);
            expected[static_cast<std::size_t>(i / steps)] +=
                2.0 * pi * sampler.pdf(static_cast<float>(c)) * width / (bins * steps);
        }
        for (std::size_t b = 0; b < bins; ++b)
            EXPECT_NEAR(measured[b], expected[b], 2e-3)
                << "bin " << b << " of " << light.inner_angle << ", " << light.outer_angle;
    }
}

TEST(LightVertices, InverseDensityIsTheLitArea) {
    const Scene scene = make_builtin_scene("builtin:sphere:0.5");
    const Surface surface(scene);
    Spotlight light = cone(40.0f, 40.0f);
    const ConeSampler sampler(light);
    std::vector<std::uint32_t> indices(4096);
    std::iota(indices.begin(), indices.end(), 0u);
    std::vector<LightVertex> vertices(indices.size());
    trace_light_vertices(surface, light, sampler, 7, indices, vertices);
    double area = 0.0;
    for (const LightVertex& y : vertices) {
        area += 1.0 / y.pdf / 4096.0;
        EXPECT_NEAR(y.radiosity[1], 0.5f, 1e-3f); // reflectance x intensity / radius^2
    }
    EXPECT_NEAR(area, 2.0 * pi * (1.0 - std::cos(40.0 * pi / 180.0)), 2e-3);
}

TEST(LightVertices, SharesOfBothWaysFollowTheirDensities) {
    const SurfacePoint v{Vec3(0.0f, 0.0f, 0.0f), Vec3::UnitZ()};
    const Vec3 y(0.0f, 1.0f, 2.0f), normal(0.0f, 0.0f, -1.0f);
    const double squared = 5.0, cosine = 2.0 / std::sqrt(5.0), light_pdf = 0.3;
    const double by_cosine = cosine / pi, by_light = light_pdf * squared / cosine;
    EXPECT_NEAR(cosine_share(v, y, normal, 0.3f), by_cosine / (by_cosine + by_light), 1e-6);
    EXPECT_EQ(cosine_share(v, y, normal, 0.0f), 1.0f);
}

} // namespace
} // namespace afterglow
