#include "basis/morton.h"
#include "basis/point_hierarchy.h"
#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/surface_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace afterglow {
namespace {

PointHierarchy make_hierarchy(const char* scene_name, const HierarchyOptions& options,
                              std::uint64_t seed = 1, HierarchyStatistics* statistics = nullptr) {
    const Scene scene = make_builtin_scene(scene_name);
    const Surface surface(scene);
    CandidateSource source(surface, {*scene.viewpoint}, seed);
    return build_hierarchy(source, options, statistics);
}

TEST(PointHierarchy, HalvesItsSpacingFromLevelToLevel) {
    HierarchyStatistics statistics;
    const PointHierarchy points =
        make_hierarchy("builtin:two_rooms",
                       {.coarse_radius = 1.0f, .levels = 4},
                       1, &statistics);
    ASSERT_EQ(points.levels(), 4);
    ASSERT_EQ(points.level_begin.size(), 5u);
    EXPECT_EQ(points.begin(0), 0u);
    EXPECT_EQ(points.position.cols(), points.size());
    EXPECT_EQ(points.normal.cols(), points.size());
    EXPECT_EQ(points.support.size(), points.size());
    EXPECT_EQ(points.reflectance.cols(), points.size());
    ASSERT_EQ(statistics.level.size(), 4u);
    for (int l = 0; l < 4; ++l) {
        EXPECT_EQ(points.spacing[l], std::ldexp(1.0f, -l));
        const std::uint32_t count = points.end(l) - points.begin(l);
        EXPECT_EQ(statistics.level[l].points, count);
        // Four times as many on a plane; somewhat less where edges and corners have their own.
        if (l > 0) {
            const double more =
                static_cast<double>(count) / (points.end(l - 1) - points.begin(l - 1));
            EXPECT_GT(more, 3.0);
            EXPECT_LT(more, 4.5);
        }
    }
}

TEST(PointHierarchy, RefusesAPlainDisplayLevelBehindOneOfOpenness) {
    HierarchyOptions options{.coarse_radius = 1.0f, .levels = 2, .finest_density = 0.15f,
                             .display = DisplayLevel{.spacing = 0.5f, .parent = 0, .openness_density = 0.0f}};
    EXPECT_THROW(make_hierarchy("builtin:two_rooms", options), UsageError);
}

TEST(PointHierarchy, OrdersEachLevelAlongAMortonCurve) {
    const PointHierarchy points =
        make_hierarchy("builtin:cornell",
                       {.coarse_radius = 0.1f, .levels = 2, .display = DisplayLevel{0.025f, 1}});
    for (int l = 0; l < 3; ++l) {
        std::vector<Vec3> positions;
        for (std::uint32_t i = points.begin(l); i < points.end(l); ++i)
            positions.push_back(points.position.col(i));
        const std::vector<std::uint32_t> order = morton_order(positions);
        EXPECT_TRUE(std::is_sorted(order.begin(), order.end())) << "level " << l;
    }
}

TEST(PointHierarchy, KeepsTheReflectanceOfTheSurface) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const PointHierarchy points =
        make_hierarchy("builtin:cornell", {.coarse_radius = 0.1f, .levels = 2});
    int red = 0;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
        const Vec3 x = points.position.col(i);
        const bool side_wall = std::abs(points.normal(0, i)) > 0.99f; // the blocks stand askew
        const bool on_green = side_wall && x.x() < 0.1f;
        const bool on_red = side_wall && x.x() > 0.5f;
        const Rgb expected = scene.materials[on_red ? 1 : on_green ? 2 : 0].reflectance;
        EXPECT_LT((points.reflectance.col(i).array() - expected).abs().maxCoeff(), 1e-6f)
            << x.transpose();
        red += on_red;
    }
    EXPECT_GT(red, 20);
}

TEST(PointHierarchy, ReachesAsFarAsItsShapeSays) {
    BasisShape shape;
    shape.reach_coarsest = 1.5f;
    shape.reach_finest = 2.5f;
    const PointHierarchy points = make_hierarchy(
        "builtin:cornell",
        {.coarse_radius = 0.2f, .levels = 3, .shape = shape});
    for (int l = 0; l < 3; ++l)
        for (std::uint32_t i = points.begin(l); i < points.end(l); ++i)
            EXPECT_FLOAT_EQ(points.support[i], (1.5f + 0.5f * l) * points.spacing[l]);
}

TEST(PointHierarchy, ReachesItsLikeWherePlacedByOpenness) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    CandidateSource source(surface, {*scene.viewpoint}, 1);
    const PointHierarchy points = build_hierarchy(source, {.coarse_radius = 0.16f,
                                                           .levels = 2,
                                                           .finest_density = 0.3f,
                                                           .display = DisplayLevel{0.04f, 1}});
    ASSERT_EQ(points.openness_level, 1);
    ASSERT_EQ(points.openness.cols(), points.end(2) - points.begin(1));
    int longer = 0, in_contacts = 0, all = 0;
    for (const int level : {1, 2}) {
        const float spacing = points.spacing[level];
        const OpennessProbe probe(surface, spacing);
        std::vector<Openness> feature;
        for (std::uint32_t i = points.begin(level); i < points.end(level); ++i) {
            feature.push_back(probe(points.point(i)));
            EXPECT_LT((points.openness_of(i) - feature.back()).cwiseAbs().maxCoeff(), 0.51f / 64.0f);
        }
        for (std::uint32_t i = points.begin(level); i < points.end(level); ++i) {
            std::vector<float> distance, alone;
            for (std::uint32_t j = points.begin(level); j < points.end(level); ++j) {
                const Vec3 n = points.normal.col(j);
                if (j == i || n.dot(points.normal.col(i)) < 0.7f) continue;
                const Vec3 d = points.position.col(j) - points.position.col(i);
                const float h = d.dot(n);
                alone.push_back(std::sqrt(d.squaredNorm() + 8.0f * h * h));
                const float difference2 =
                    (feature[j - points.begin(level)] - feature[i - points.begin(level)])
                        .squaredNorm();
                distance.push_back(alone.back() * std::exp(difference2 / 0.0225f));
            }
            std::sort(distance.begin(), distance.end());
            std::sort(alone.begin(), alone.end());
            const float expected =
                std::min(1.5f * distance[3], (level == 2 ? 2.25f : 1.28f) * spacing);
            // Only the closest neighbours are looked at: where the like are farther, a little more.
            EXPECT_GE(points.support[i], 0.999f * expected);
            longer += points.support[i] > 1.001f * expected;
            in_contacts += expected > 1.5f * alone[3];
            ++all;
        }
    }
    EXPECT_LT(longer, all / 20);
    EXPECT_GT(in_contacts, all / 20) << "openness hardly differs: the test shows nothing";
}

TEST(PointHierarchy, DependsOnTheSeedButNotOnThreads) {
    const auto make = [](int threads, std::uint64_t seed) {
        const ThreadLimit limit(threads);
        return make_hierarchy("builtin:two_rooms",
                              {.coarse_radius = 1.0f, .levels = 2, .display = DisplayLevel{0.25f, 1}},
                              seed);
    };
    const PointHierarchy one = make(1, 5), two = make(2, 5), other = make(2, 6);
    EXPECT_EQ(one.level_begin, two.level_begin);
    EXPECT_EQ(one.position, two.position);
    EXPECT_EQ(one.normal, two.normal);
    EXPECT_EQ(one.support, two.support);
    EXPECT_EQ(one.reflectance, two.reflectance);
    EXPECT_NE(one.level_begin, other.level_begin);
}

} // namespace
} // namespace afterglow
