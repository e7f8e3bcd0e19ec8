#include "core/builtin_scenes.h"
#include "core/parallel.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

namespace afterglow {
namespace {

using std::numbers::pi;

/// Small operators for what does not depend on accuracy.
PrecomputeOptions quick(float coarse_radius) {
    PrecomputeOptions options;
    options.coarse_radius = coarse_radius;
    options.receiver_levels = 3;
    options.sender_levels = 2;
    options.links.rays = 128;
    return options;
}

Spotlight spot(const Vec3& position, const Vec3& direction, float inner, float outer) {
    Spotlight light{.position = position,
                    .direction = direction,
                    .inner_angle = inner,
                    .outer_angle = outer,
                    .intensity = Rgb(3.0f, 2.0f, 1.0f)};
    light.check();
    return light;
}

/// Watts of the green channel: full inside the inner cone, ((c - cos b) / (cos a - cos b))^2 up to
/// the outer one.
double flux(const Spotlight& light) {
    const double a = std::cos(light.inner_angle * pi / 180.0);
    const double b = std::cos(light.outer_angle * pi / 180.0);
    return light.intensity[1] * 2.0 * pi * ((1.0 - a) + (a - b) / 3.0);
}

/// Mean over a scene's area, front sides, of the green channel.
double mean_irradiance(const Display& display, const std::vector<SurfacePoint>& places,
                       const VectorIrradiance& field) {
    return parallel_sum<double>(static_cast<Index>(places.size()), 0.0,
                                [&](Index i) {
                                    bool covered = false;
                                    return static_cast<double>(
                                        display.net_irradiance(places[i], field, covered).max(0.0f)[1]);
                                })
           / static_cast<double>(places.size());
}

double difference(const std::vector<float>& a, const std::vector<float>& b) {
    const auto x = Eigen::VectorXf::Map(a.data(), static_cast<Index>(a.size())).cast<double>();
    const auto y = Eigen::VectorXf::Map(b.data(), static_cast<Index>(b.size())).cast<double>();
    return (x - y).norm() / y.norm();
}

TEST(LightTransport, FillsAClosedRoomWithRhoOverOneMinusRhoTimesTheDirectLight) {
    // Default settings. All light ends on the walls: mean direct irradiance is flux / area, and
    // each bounce returns the share rho. Links know nothing of reflectance, so that one operator
    // serves all furnaces. The field varies by a fifth over the walls: the mean of 20000 stratified
    // places is exact to .1 %.
    const Scene scene = make_builtin_scene("builtin:furnace:0.5");
    const Surface surface(scene);
    TransferOperator transfer = precompute(surface, {});
    EXPECT_TRUE((transfer.points.reflectance.array() == 0.5f).all());
    const Display display(transfer, surface);
    const std::vector<SurfacePoint> places = points_by_area(scene, 20'000, 3);
    const Spotlight lights[] = {
        spot(Vec3(0.2f, 0.7f, -0.1f), Vec3(0.1f, -1.0f, 0.2f), 40.0f, 80.0f),
        spot(Vec3(-0.3f, 0.1f, 0.2f), Vec3(1.0f, 0.2f, -0.3f), 60.0f, 180.0f),
        spot(Vec3(0.5f, -0.5f, 0.5f), Vec3(-1.0f, 0.4f, -0.6f), 20.0f, 45.0f)};
    for (const auto& [rho, tolerance] :
         {std::pair(0.5, 0.005), std::pair(0.8, 0.01), std::pair(0.95, 0.01)}) {
        transfer.points.reflectance.setConstant(static_cast<float>(rho));
        const LightTransport transport(transfer, surface);
        for (const Spotlight& light : lights) {
            NeumannStatistics statistics;
            const VectorIrradiance field = transport.indirect(light, &statistics);
            const double exact = rho / (1.0 - rho) * flux(light) / 24.0;
            EXPECT_NEAR(mean_irradiance(display, places, field) / exact, 1.0, tolerance)
                << "rho " << rho << ", cone " << light.outer_angle;
            EXPECT_LE(statistics.residual, 2e-3);
        }
    }
}

TEST(LightTransport, SumsAsManyBouncesAsThereAre) {
    // T N e against T (e + M e + M^2 e + ...), a hundred and then four hundred terms, at rho = .95,
    // where the hundred-and-first bounce is still .6 % of the first.
    const Scene scene = make_builtin_scene("builtin:furnace:0.95");
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, quick(0.6f));
    const LightTransport transport(transfer, surface);
    const Radiosity direct = transport.direct_radiosity(
        spot(Vec3(0.2f, 0.7f, -0.1f), Vec3(0.1f, -1.0f, 0.2f), 20.0f, 45.0f));
    Radiosity sum = direct, bounce = direct;
    double share_of_100 = 0.0;
    const VectorIrradiance all = transport.gather(transport.all_bounces(direct, 1e-5));
    for (int k = 1; k <= 400; ++k) {
        bounce = transport.bounce(bounce);
        for (std::size_t i = 0; i < sum.size(); ++i)
            sum[i] += bounce[i];
        if (k == 100) share_of_100 = difference(transport.gather(sum), all);
    }
    EXPECT_GT(share_of_100, 0.002); // bounces beyond the hundredth count
    EXPECT_LT(share_of_100, 0.02);
    EXPECT_LT(difference(transport.gather(sum), all), 1e-3);

    NeumannStatistics statistics;
    const VectorIrradiance usual =
        transport.gather(transport.all_bounces(direct, 2e-3, &statistics));
    EXPECT_LT(statistics.products, 12);
    EXPECT_LT(difference(usual, all), 0.01);
}

TEST(LightTransport, IsLinearInTheLight) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, quick(0.1f));
    const LightTransport transport(transfer, surface);
    const Radiosity a = transport.direct_radiosity(
        spot(Vec3(0.278f, 0.5f, 0.2795f), Vec3(0, -1, 0), 20.0f, 50.0f));
    const Radiosity b = transport.direct_radiosity(
        spot(Vec3(0.1f, 0.1f, 0.1f), Vec3(1, 1, 1), 10.0f, 30.0f));
    Radiosity combined(a.size());
    for (std::size_t i = 0; i < a.size(); ++i)
        combined[i] = 2.0f * a[i] - 0.5f * b[i];
    const auto linear = [&](auto&& apply) {
        const std::vector<float> of_a = apply(a), of_b = apply(b);
        std::vector<float> expected(of_a.size());
        for (std::size_t i = 0; i < expected.size(); ++i)
            expected[i] = 2.0f * of_a[i] - 0.5f * of_b[i];
        return difference(apply(combined), expected);
    };
    EXPECT_LT(linear([&](const Radiosity& f) { return transport.bounce(f); }), 1e-5);
    EXPECT_LT(linear([&](const Radiosity& f) { return transport.gather(f); }), 1e-5);
    EXPECT_LT(linear([&](const Radiosity& f) { return transport.all_bounces(f, 1e-5); }), 1e-4);
}

TEST(LightTransport, BouncesByReflectanceTimesTheGatheredIrradiance) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, quick(0.1f));
    const LightTransport transport(transfer, surface);
    const Radiosity direct = transport.direct_radiosity(
        spot(Vec3(0.278f, 0.5f, 0.2795f), Vec3(0, -1, 0), 20.0f, 50.0f));
    const Radiosity bounce = transport.bounce(direct);
    const VectorIrradiance field = transport.gather(direct);
    ASSERT_EQ(direct.size(), 3 * transfer.senders());
    ASSERT_EQ(field.size(), 9 * transfer.points.size());
    double lit = 0.0;
    for (std::uint32_t m = 0; m < transfer.senders(); ++m)
        for (int c = 0; c < 3; ++c) {
            double irradiance = 0.0;
            for (int axis = 0; axis < 3; ++axis)
                irradiance += transfer.points.normal(axis, m) * field[9 * m + 3 * axis + c];
            ASSERT_NEAR(bounce[3 * m + c], transfer.points.reflectance(c, m) * irradiance, 1e-5);
            lit += direct[3 * m + c];
        }
    EXPECT_GT(lit, 0.0);
}

TEST(LightTransport, OfDarknessIsDark) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, quick(0.2f));
    const LightTransport transport(transfer, surface);
    const Radiosity dark(3 * transfer.senders(), 0.0f);
    for (const float v : transport.gather(transport.all_bounces(dark)))
        ASSERT_EQ(v, 0.0f);
}

TEST(LightTransport, DoesNotLeakIntoAClosedRoom) {
    // Default settings; both rooms have points because the automatic viewpoints find both.
    const Scene scene = make_builtin_scene("builtin:two_rooms_closed");
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, {});
    const Display display(transfer, surface);
    const LightTransport transport(transfer, surface);
    std::vector<SurfacePoint> rooms[2];
    for (const SurfacePoint& x : points_by_area(scene, 10'000, 4))
        rooms[x.position.x() > 4.025f].push_back(x);
    for (const int lit : {0, 1}) {
        const float x = lit == 0 ? 2.5f : 5.5f; // towards the wall between the rooms
        const VectorIrradiance field = transport.indirect(
            spot(Vec3(x, 1.4f, 2.0f), Vec3(lit == 0 ? 1.0f : -1.0f, -0.2f, 0.1f), 20.0f, 50.0f));
        for (const auto& room : rooms)
            for (const SurfacePoint& place : room) {
                bool covered = false;
                display.net_irradiance(place, field, covered).max(0.0f);
                EXPECT_TRUE(covered) << place.position.transpose();
            }
        const double light = mean_irradiance(display, rooms[lit], field);
        const double leak = mean_irradiance(display, rooms[1 - lit], field);
        EXPECT_GT(light, 0.01);
        EXPECT_LT(leak, 0.005 * light) << "light in room " << lit + 1;
    }
}

} // namespace
} // namespace afterglow
