#include "basis/morton.h"
#include "basis/point_hierarchy.h"
#include "core/builtin_scenes.h"
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

TEST(PointHierarchy, OverlapsAboutAsMuchWhereOpennessCrowdsItsFinestLevel) {
    const PointHierarchy points =
        make_hierarchy("builtin:furnace",
                       {.coarse_radius = 0.4f, .levels = 2, .display = DisplayLevel{0.1f, 1}});
    double in_edges = 0.0, in_faces = 0.0, mean_support[2] = {};
    int count_edges = 0, count_faces = 0, count_support[2] = {};
    const auto near_edge = [](const Vec3& x) {
        Vec3 side = x.cwiseAbs();
        std::sort(side.data(), side.data() + 3);
        return side[1] > 0.95f; // half of R
    };
    for (std::uint32_t i = points.begin(2); i < points.end(2); ++i) {
        EXPECT_GT(points.support[i], 1.5f * points.spacing[2] / 32.0f);
        EXPECT_LE(points.support[i], 2.25f * points.spacing[2]);
        const int edge = near_edge(points.position.col(i));
        mean_support[edge] += points.support[i];
        ++count_support[edge];
    }
    EXPECT_LT(mean_support[1] / count_support[1], 0.95 * mean_support[0] / count_support[0]);
    for (const SurfacePoint& x : points_by_area(make_builtin_scene("builtin:furnace"), 2000, 3)) {
        int overlapping = 0;
        for (std::uint32_t i = points.begin(2); i < points.end(2); ++i)
            overlapping += (points.position.col(i) - x.position).norm() < points.support[i]
                           && points.normal.col(i).dot(x.normal) > 0.9f;
        EXPECT_GE(overlapping, 1);
        const bool edge = near_edge(x.position);
        (edge ? in_edges : in_faces) += overlapping;
        ++(edge ? count_edges : count_faces);
    }
    const double edges = in_edges / count_edges, faces = in_faces / count_faces;
    EXPECT_GT(faces, 5.0);
    EXPECT_LT(faces, 15.0);
    EXPECT_LT(edges, 2.0 * faces);
    EXPECT_GT(edges, 0.5 * faces);
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
