#include "core/polygon.h"
#include "core/sampling.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>

namespace afterglow {
namespace {

using Polygon = std::vector<Vec3>;

Vec3 twice_area(const Vec3& a, const Vec3& b, const Vec3& c) {
    return (b - a).cross(c - a);
}

/// Checks that the triangles lie side by side and fill the polygon: all turn like it, and their
/// areas sum to its own.
void expect_partition(const Polygon& polygon) {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    triangulate(polygon, triangles);
    ASSERT_EQ(triangles.size(), polygon.size() - 2);

    Vec3 whole = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < polygon.size(); ++i)
        whole += twice_area(polygon[0], polygon[i], polygon[i + 1]);
    float sum = 0.0f;
    for (const auto& t : triangles) {
        const Vec3 n = twice_area(polygon[t[0]], polygon[t[1]], polygon[t[2]]);
        EXPECT_GE(n.dot(whole), -1e-6f * whole.squaredNorm());
        sum += n.norm();
    }
    EXPECT_NEAR(sum, whole.norm(), 1e-4f * whole.norm());
}

Polygon mapped(const Polygon& flat, const Vec3& x, const Vec3& y) {
    Polygon polygon;
    for (const Vec3& p : flat)
        polygon.push_back(p.x() * x + p.y() * y + Vec3(1, 2, 3));
    return polygon;
}

TEST(Triangulate, FillsConcavePolygonsOnAnyPlane) {
    const std::vector<Polygon> shapes = {
        {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}},                       // square
        {{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {0.5f, 1, 0}},                    // dart
        {{0.5f, 1, 0}, {0, 0, 0}, {2, 1, 0}, {0, 2, 0}},                    // the same, turned
        {{0, 0, 0}, {3, 0, 0}, {3, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}}, // L
        {{0, 0, 0},
         {5, 0, 0},
         {5, 3, 0},
         {4, 3, 0},
         {4, 1, 0},
         {3, 1, 0},
         {3, 3, 0},
         {2, 3, 0},
         {2, 1, 0},
         {1, 1, 0},
         {1, 3, 0},
         {0, 3, 0}},                                                        // comb
        {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 2, 0}, {0, 2, 0}}, // on a line
    };
    const Frame tilted(Vec3(1, 2, -3).normalized());
    for (const Polygon& shape : shapes)
        for (const auto& [x, y] : std::vector<std::pair<Vec3, Vec3>>{{Vec3::UnitX(), Vec3::UnitY()},
                                                                     {Vec3::UnitY(), Vec3::UnitX()},
                                                                     {Vec3::UnitY(), Vec3::UnitZ()},
                                                                     {Vec3::UnitX(), Vec3::UnitZ()},
                                                                     {tilted.x, tilted.y}})
            expect_partition(mapped(shape, x, y));
}

TEST(Triangulate, FillsAPolygonWithABridgedHole) {
    // A square with a square hole, joined by a bridge whose ends are used twice.
    expect_partition({{0, 0, 0},
                      {3, 0, 0},
                      {3, 3, 0},
                      {0, 3, 0},
                      {0, 0, 0},
                      {1, 1, 0},
                      {1, 2, 0},
                      {2, 2, 0},
                      {2, 1, 0},
                      {1, 1, 0}});
}

TEST(Triangulate, FillsRandomStars) {
    Rng rng(1, 0);
    for (int round = 0; round < 200; ++round) {
        const int n = 5 + round / 4;
        Polygon star;
        for (int i = 0; i < n; ++i) {
            const float angle = static_cast<float>(2.0 * EIGEN_PI * i / n);
            const float radius = 0.2f + rng.uniform();
            star.emplace_back(radius * std::cos(angle), 0.0f, -radius * std::sin(angle));
        }
        expect_partition(star);
    }
}

TEST(Triangulate, FillsASpiralOfThousandsOfCorners) {
    for (const int turns : {3, 6}) {
        constexpr int steps = 1500;
        Polygon spiral;
        const auto at = [&](int k, float radius) {
            const float angle = static_cast<float>(2.0 * EIGEN_PI * turns * k / steps);
            return Vec3(radius * std::cos(angle), radius * std::sin(angle), 0.0f);
        };
        const auto radius = [&](int k) { return 1.0f + static_cast<float>(turns * k) / steps; };
        for (int k = 0; k < steps; ++k) spiral.push_back(at(k, radius(k) + 0.5f));
        for (int k = steps; k-- > 0;) spiral.push_back(at(k, radius(k)));
        expect_partition(spiral);
    }
}

TEST(Triangulate, CutsAQuadrilateralAlongItsShorterDiagonal) {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    triangulate(Polygon{{-3, 0, 0}, {0, -1, 0}, {3, 0, 0}, {0, 1, 0}}, triangles);
    EXPECT_EQ(triangles, (std::vector<std::array<std::uint32_t, 3>>{{0, 1, 3}, {1, 2, 3}}));
}

TEST(Triangulate, GivesAllTrianglesForPolygonsThatCrossThemselvesOrHaveNoArea) {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    triangulate(Polygon{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}, {2, 5, 0}}, triangles);
    triangulate(Polygon(7, Vec3(1, 1, 1)), triangles);
    triangulate(Polygon{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}, {4, 0, 0}}, triangles);
    EXPECT_EQ(triangles.size(), 3u + 5u + 3u);
}

TEST(Triangulate, TakesNoTimeBySquaresWhereAllCornersButOneLieOnOneEdge) {
    const auto seconds = [](int corners) { // of the processor
        Polygon flat = {{0, 1, 0}};
        for (int i = 0; i < corners; ++i) flat.emplace_back(static_cast<float>(i), 0.0f, 0.0f);
        std::vector<std::array<std::uint32_t, 3>> triangles;
        const std::clock_t start = std::clock();
        triangulate(flat, triangles);
        EXPECT_EQ(triangles.size(), flat.size() - 2);
        return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    };
    EXPECT_LT(seconds(8000) / seconds(2000), 8.0); // 4 where it is linear, or else 16
}

TEST(Triangulate, EndsSoonOnAMonstrousPolygon) {
    Rng rng(2, 0);
    Polygon scribble;
    for (int i = 0; i < 10'000; ++i)
        scribble.emplace_back(rng.uniform(), rng.uniform(), 0.0f);
    std::vector<std::array<std::uint32_t, 3>> triangles;
    triangulate(scribble, triangles);
    EXPECT_EQ(triangles.size(), scribble.size() - 2);
}

} // namespace
} // namespace afterglow
