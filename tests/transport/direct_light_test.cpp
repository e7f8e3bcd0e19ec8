#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace afterglow {
namespace {

using std::numbers::pi;

constexpr const char* furnace = "builtin:furnace:0.5";

/// A closed box of two metres with reflectance 1/2 and senders on it.
struct LitFurnace {
    Scene scene;
    Surface surface{scene};
    TransferOperator transfer;
    DirectLight direct{transfer.points, transfer.sender_levels - 1, transfer.sender_areas, surface};

    explicit LitFurnace(float coarse_radius, Scene of = make_builtin_scene(furnace))
        : scene(std::move(of)), transfer(precompute(surface, options(coarse_radius))) {}

    static PrecomputeOptions options(float coarse_radius) {
        PrecomputeOptions options;
        options.coarse_radius = coarse_radius;
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
            sum += static_cast<double>(radiosity[3 * j + 1]) * std::max(0.0f, transfer.sender_areas[j]);
        return sum;
    }
};

const LitFurnace& example() {
    static const LitFurnace made(0.4f);
    return made;
}

/// With senders half as far apart.
const LitFurnace& finer_example() {
    static const LitFurnace made(0.2f);
    return made;
}

/// The furnace with shading normals that all lean by so many degrees from the triangles' own.
Scene leaning_furnace(float degrees) {
    Scene scene = make_builtin_scene(furnace);
    const float angle = degrees * static_cast<float>(pi / 180.0);
    for (std::uint32_t n = 0; n < scene.triangles.size(); ++n) {
        const Frame frame(scene.triangle_normal(n));
        scene.normals.push_back(frame.to_world({std::sin(angle), 0.0f, std::cos(angle)}));
        scene.normal_indices.push_back({n, n, n});
    }
    return scene;
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
    return light.intensity[1] * 2.0 * pi * (1.0 - cos_degrees(light.outer_angle)); // a float, as falloff() has it
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

TEST(DirectLight, LosesNoneOnAnEdge) {
    // There lie functions that no receiver sees, for they are small in the rows of all patches.
    ASSERT_GT(std::ranges::count(example().transfer.sender_areas, SenderRows::in_few_rows), 0);
    for (int k = 0; k < 60; ++k) {
        const float along = -0.99f + 1.98f * static_cast<float>(k) / 59.0f;
        const Spotlight light = spot(Vec3(0.1f, 0.2f, -0.3f), Vec3(along, -1.0f, 1.0f) - Vec3(0.1f, 0.2f, -0.3f), 0.1f);
        EXPECT_NEAR(example().power(example().radiosity(light)) / (0.5 * flux(light)), 1.0, 0.001) << along;
    }
}

TEST(DirectLight, GlaresOnNoEdge) {
    // Spots a few functions wide along an edge, all splatted: no function of it, however little patches'
    // centres see of it, becomes brighter than the brightest place.
    const Vec3 from(0.1f, 0.2f, -0.3f);
    for (int k = 0; k < 60; ++k) {
        const Vec3 on_edge(-0.99f + 1.98f * static_cast<float>(k) / 59.0f, -1.0f, 1.0f);
        const Spotlight light = spot(from, on_edge - from, 7.0f);
        ASSERT_EQ(sampled_share(light, (on_edge - from).norm(), example().spacing()), 0.0f);
        const Radiosity radiosity = example().radiosity(light);
        float brightest = 0.0f;
        for (std::size_t j = 0; j < radiosity.size() / 3; ++j) {
            SurfacePoint x = example().transfer.points.point(example().begin() + static_cast<std::uint32_t>(j));
            brightest = std::max(brightest, 0.5f * direct_irradiance(example().surface, light, x)[1]);
        }
        for (std::size_t j = 1; j < radiosity.size(); j += 3)
            EXPECT_LE(radiosity[j], 2.5f * brightest) << on_edge.transpose();
    }
}

TEST(DirectLight, CountsWhatFallsOnTheShadingNormal) {
    // Straight down from close by, so that all is splatted: irradiance is less by the cosine of the lean.
    constexpr float lean = 40.0f;
    const LitFurnace leaning(0.4f, leaning_furnace(lean));
    const double cosine = std::cos(lean * pi / 180.0);
    for (const float spacings : {2.0f, 3.5f}) {
        const Spotlight light = spot(Vec3(0.1f, spacings * leaning.spacing() - 1.0f, 0.2f), -Vec3::UnitY(), 1.0f);
        EXPECT_NEAR(leaning.power(leaning.radiosity(light)) / (0.5 * flux(light)), cosine, 0.002) << spacings;
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

/// E at places within a quarter of a spacing around a point, their mean over a fine grid.
Rgb mean_around(const Spotlight& light, const SurfacePoint& x, float radius) {
    constexpr int steps = 40;
    const Frame frame(x.normal);
    Rgb sum = Rgb::Zero();
    int count = 0;
    for (int a = 0; a < steps; ++a)
        for (int b = 0; b < steps; ++b) {
            const Vec2 at = Vec2(a + 0.5f, b + 0.5f) * (2.0f / steps) - Vec2::Ones();
            if (at.norm() > 1.0f) continue;
            const Vec3 y = x.position + frame.to_world(radius * Vec3(at.x(), at.y(), 0.0f));
            sum += direct_irradiance(finer_example().surface, light, {y, x.normal});
            ++count;
        }
    return sum / static_cast<float>(count);
}

TEST(DirectLight, OfAFarLightIsSampledAtThePointsAndAroundThemAtAnEdge) {
    const Spotlight light = spot(Vec3(0.0f, 0.9f, 0.0f), -Vec3::UnitY(), 22.0f); // a hard circle
    ASSERT_GT(sampled_share(light, 1.9f, finer_example().spacing()), 0.999f);
    const float radius = 0.25f * finer_example().spacing();
    const Radiosity radiosity = finer_example().radiosity(light);
    int lit = 0, partly = 0;
    for (std::uint32_t j = 0; j < radiosity.size() / 3; ++j) {
        const SurfacePoint x = finer_example().transfer.points.point(finer_example().begin() + j);
        if (x.position.y() > -0.99f) continue; // on the floor all is far
        const Vec3 aim = light.position - x.position;
        const float unoccluded =
            0.5f * light.intensity[0] * aim.y() / (aim.squaredNorm() * aim.norm());
        const Rgb mean = 0.5f * mean_around(light, x, radius);
        const Rgb at_point = 0.5f * direct_irradiance(finer_example().surface, light, x);
        const float found = radiosity[3 * j];
        if (mean[0] == 0.0f || std::abs(mean[0] / unoccluded - 1.0f) < 0.01f) {
            EXPECT_NEAR(found, at_point[0], 0.02f * unoccluded); // all around is alike
            lit += found > 0.0f;
        } else {
            EXPECT_NEAR(found, mean[0], 0.1875f * unoccluded); // of eight places, one and a half
            ++partly;
        }
    }
    EXPECT_GT(lit, 20);
    EXPECT_GT(partly, 10);
}

TEST(DirectLight, AnEdgeThatPassesSwitchesNoSenderAtOnce) {
    // A hard circle of light that walks in steps of a two-hundredth of a spacing: of eight places it passes
    // no three at once.
    const float step = finer_example().spacing() / 200.0f;
    Radiosity last;
    for (int k = 0; k < 120; ++k) {
        const Spotlight light = spot(Vec3(static_cast<float>(k) * step, 0.9f, 0.0f),
                                     -Vec3::UnitY(), 22.0f);
        const Radiosity now = finer_example().radiosity(light);
        const float full = 0.5f * light.intensity[0] / (1.9f * 1.9f);
        for (std::size_t j = 0; j < last.size(); j += 3)
            EXPECT_LE(std::abs(now[j] - last[j]), 0.26f * full) << "step " << k;
        last = now;
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
