#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/quad.h"
#include "tests/support/small_transfer.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"
#include "transport/path_tracer.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace afterglow {
namespace {

PrecomputeOptions quick() {
    PrecomputeOptions options = small_options();
    options.coarse_radius = 0.2f;
    return options;
}

bool equal(const TransferOperator& a, const TransferOperator& b) {
    const auto same_rows = [](const auto& x, const auto& y) {
        return std::equal(x.index.span().begin(), x.index.span().end(), y.index.span().begin(),
                          y.index.span().end())
               && std::equal(x.value.span().begin(), x.value.span().end(), y.value.span().begin(),
                             y.value.span().end());
    };
    return a.points.level_begin == b.points.level_begin && a.points.position == b.points.position
           && same_rows(a.pull.children, b.pull.children) && same_rows(a.push.parents, b.push.parents)
           && std::ranges::equal(a.links.begin.span(), b.links.begin.span())
           && std::ranges::equal(a.links.entry.span(), b.links.entry.span());
}

TEST(Precompute, DependsOnTheSeedButNotOnThreads) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const auto make = [&](int threads, std::uint64_t seed) {
        const ThreadLimit limit(threads);
        PrecomputeOptions options = quick();
        options.seed = seed;
        return precompute(surface, options);
    };
    const TransferOperator one = make(1, 5);
    EXPECT_TRUE(equal(one, make(2, 5)));
    EXPECT_FALSE(equal(one, make(2, 6)));
}

TEST(Precompute, MakesWhatItsOptionsSay) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    PrecomputeReport report;
    const TransferOperator transfer = precompute(surface, quick(), &report);
    EXPECT_EQ(transfer.points.levels(), 3);
    EXPECT_EQ(transfer.sender_levels, 2);
    EXPECT_EQ(transfer.points.spacing[0], 0.2f);
    EXPECT_EQ(transfer.senders(), transfer.points.end(1));
    EXPECT_EQ(transfer.pull.children.rows(), transfer.points.begin(1));
    EXPECT_EQ(transfer.links.rows(), transfer.points.size());
    EXPECT_EQ(transfer.push.parents.rows(), transfer.points.size());
    EXPECT_GE(report.links.rays, 64u * transfer.points.size());
    EXPECT_EQ(report.viewpoints.size(), 1u);
    EXPECT_GT(report.total_seconds, 0.0);
}

// As if the wider spacing had been asked for by itself, with fewer rays.
TEST(Precompute, WiderFunctionsCastFewerRays) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const auto expect_rays = [&](float coarse_scale, int rays, int cast) {
        PrecomputeOptions options = small_options();
        options.coarse_radius = 0.0f;
        options.coarse_scale = coarse_scale;
        options.links.rays = rays;
        const TransferOperator scaled = precompute(surface, options);
        options.coarse_radius = scaled.points.spacing[0]; // then the scale is not looked at
        options.links.rays = cast;
        EXPECT_TRUE(equal(scaled, precompute(surface, options))) << "spacing times " << coarse_scale;
    };
    expect_rays(4.0f, 512, 128);
    expect_rays(4.0f, 2048, 256);
    expect_rays(3.0f, 1024, 256);
    expect_rays(4.0f, 64, 64);
    expect_rays(1.2f, 128, 128);
}

TEST(Precompute, StaysInSightOfAGivenViewpoint) {
    const Scene scene = make_builtin_scene("builtin:two_rooms_closed");
    const Surface surface(scene);
    PrecomputeOptions options = quick();
    options.coarse_radius = 1.5f;
    options.viewpoint = Vec3(6.0f, 1.4f, 2.0f);
    const TransferOperator second = precompute(surface, options);
    EXPECT_GT(second.points.position.row(0).minCoeff(), 4.025f);
    options.viewpoint.reset();
    const TransferOperator both = precompute(surface, options);
    EXPECT_LT(both.points.position.row(0).minCoeff(), 1.0f);
    EXPECT_GT(both.points.position.row(0).maxCoeff(), 7.0f);
}

TEST(Precompute, FindsARoomWhoseFloorReachesFar) {
    // A furnace whose floor is one quad of 800 m, its viewpoint and size found by itself.
    Scene scene = make_builtin_scene("builtin:furnace:0.5");
    ASSERT_EQ(std::erase_if(scene.triangles, [&](const Triangle& t) {
                  return std::ranges::all_of(t, [&](std::uint32_t v) { return scene.positions[v].y() == -1.0f; });
              }), 2u);
    scene.material_index.resize(scene.triangles.size()); // all of one material
    add_quad(scene, {Vec3(-400, -1, -400), Vec3(-400, -1, 400), Vec3(400, -1, 400), Vec3(400, -1, -400)});
    scene.viewpoint.reset();
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, medium_options());

    Spotlight light{.position = {0.1f, 0.6f, 0.0f}, .direction = {0.1f, -1.0f, 0.2f}, .inner_angle = 30.0f, .outer_angle = 40.0f};
    light.check();
    const std::vector<SurfacePoint> places = points_in_sight(surface, Vec3::Zero(), 300, 5);
    const Eigen::Array3Xf wanted = estimate_irradiance(surface, {&light, 1}, places, {.samples = 256}).indirect;
    const Eigen::Array3Xf found = Display(transfer, surface)
                                      .irradiance(places, LightTransport(transfer, surface).indirect(light), light);
    EXPECT_NEAR(found.mean() / wanted.mean(), 1.0f, 0.05f);
    EXPECT_LT(std::sqrt((found - wanted).square().mean()) / wanted.mean(), 0.15f);
}

TEST(Precompute, FewRaysMakeNeitherLightNorLinks) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    Spotlight light{.position = Vec3(0.278f, 0.5f, 0.2795f), .inner_angle = 30.0f, .outer_angle = 35.0f};
    light.check();
    std::uint64_t links[2];
    double mean[2]; // of indirect irradiance
    for (const int k : {0, 1}) {
        PrecomputeOptions options;
        options.receiver_levels = 5;
        options.sender_levels = 4;
        options.links.rays = k == 0 ? 64 : 512;
        const TransferOperator transfer = precompute(surface, options);
        const VectorIrradiance field = LightTransport(transfer, surface).indirect(light);
        links[k] = transfer.link_count();
        mean[k] = 0.0;
        const PointHierarchy& points = transfer.points;
        for (std::uint32_t i = points.begin(4); i < points.end(4); ++i)
            for (int a = 0; a < 3; ++a)
                for (int c = 0; c < 3; ++c)
                    mean[k] += static_cast<double>(points.normal(a, i) * field[9 * std::size_t{i} + 3 * a + c]);
    }
    EXPECT_NEAR(mean[0] / mean[1], 1.0, 0.01);
    EXPECT_LT(static_cast<double>(links[0]), 1.5 * static_cast<double>(links[1]));
}

TEST(Precompute, RefusesImpossibleOptions) {
    const Scene scene = make_builtin_scene("builtin:furnace");
    const Surface surface(scene);
    const auto expect_refusal = [&](auto&& change) {
        PrecomputeOptions options = quick();
        change(options);
        EXPECT_THROW(precompute(surface, options), UsageError);
    };
    expect_refusal([](auto& o) { o.receiver_levels = 1; });
    expect_refusal([](auto& o) { o.receiver_levels = 11; });
    expect_refusal([](auto& o) { o.sender_levels = 0; });
    expect_refusal([](auto& o) { o.sender_levels = 11; });
    expect_refusal([](auto& o) { o.coarse_radius = -1.0f; });
    expect_refusal([](auto& o) { o.coarse_radius = std::numeric_limits<float>::quiet_NaN(); });
    expect_refusal([](auto& o) { o.links.rays = 100; });
    expect_refusal([](auto& o) { o.links.rays = 8; });
}

} // namespace
} // namespace afterglow
