#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/support/quad.h"
#include "transport/patches.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace afterglow {
namespace {

/// One triangle in the plane z = 0.
Scene single_triangle(const Vec3& a, const Vec3& b, const Vec3& c) {
    Scene scene;
    scene.positions = {a, b, c};
    scene.triangles = {{0, 1, 2}};
    scene.material_index = {0};
    scene.materials = {{}};
    return scene;
}

/// A uniform random place on a triangle, seen from a random side.
Hit random_hit(std::uint32_t triangle, Rng& rng) {
    const float s = std::sqrt(rng.uniform()), r = rng.uniform();
    Hit hit;
    hit.distance = 1.0f;
    hit.primitive = triangle;
    hit.u = s * (1.0f - r);
    hit.v = s * r;
    hit.back_side = rng.uniform() < 0.5f;
    return hit;
}

Vec3 place(const Scene& scene, const Hit& hit) {
    const Triangle& t = scene.triangles[hit.primitive];
    return (1.0f - hit.u - hit.v) * scene.positions[t[0]] + hit.u * scene.positions[t[1]]
           + hit.v * scene.positions[t[2]];
}

void expect_centres_close_to_their_hits(const Scene& scene, float size, const std::string& what) {
    const PatchGrid grid(scene, size);
    Rng rng(3, 0);
    for (int k = 0; k < 20'000; ++k) {
        const Hit hit = random_hit(static_cast<std::uint32_t>(k % scene.triangles.size()), rng);
        const std::uint32_t patch = grid.patch_of(hit);
        ASSERT_LT(patch, grid.patch_count());
        const Hit center = grid.center(patch);
        const Triangle& t = scene.triangles[hit.primitive];
        float longest = 0.0f;
        for (std::size_t e = 0; e < 3; ++e)
            longest = std::max(longest, (scene.positions[t[e]] - scene.positions[t[(e + 1) % 3]]).norm());
        const bool shared = longest < 0.51f * size; // a cell of several triangles
        if (!shared) {
            ASSERT_EQ(center.primitive, hit.primitive) << what;
        }
        ASSERT_EQ(center.back_side, hit.back_side) << what;
        ASSERT_EQ(patch % 2, static_cast<std::uint32_t>(hit.back_side));
        ASSERT_GE(center.u, 0.0f);
        ASSERT_GE(center.v, 0.0f);
        ASSERT_LE(center.u + center.v, 1.0f) << what << ": the centre is outside its triangle";
        // Within a cell whose sides are `size` no two places are farther apart than twice that; in a
        // cube of 3/4 size two centroids are 1.3 apart, and places in small triangles a third more each.
        ASSERT_LT((place(scene, hit) - place(scene, center)).norm(), (shared ? 1.3f + 2.0f / 3.0f * 0.5f : 1.2f) * size)
            << what << ", size " << size << ", hit " << hit.u << ' ' << hit.v;
    }
}

TEST(PatchGrid, HasItsCentresCloseToTheHits) {
    for (const auto& [name, size] : {std::pair("builtin:cornell", 0.01f),
                                     {"builtin:cornell", 0.2f},
                                     {"builtin:cornell", 5.0f},
                                     {"builtin:sphere:0.5", 0.01f},
                                     {"builtin:two_rooms", 0.05f}})
        expect_centres_close_to_their_hits(make_builtin_scene(name), size, name);
}

TEST(PatchGrid, HasItsCentresCloseToTheHitsOnSlivers) {
    // Ten long, a tenth wide, the short edge in each of the three places.
    const Vec3 a(0, 0, 0), b(10, 0, 0), c(10, 0.1f, 0);
    expect_centres_close_to_their_hits(single_triangle(a, b, c), 0.2f, "abc");
    expect_centres_close_to_their_hits(single_triangle(b, c, a), 0.2f, "bca");
    expect_centres_close_to_their_hits(single_triangle(c, a, b), 0.2f, "cab");
}

TEST(PatchGrid, CutsTheGroundFinelyWhereItIsUsedHoweverFarItReaches) {
    for (const float reach : {100.0f, 1e3f, 1e5f}) {
        const Scene scene = single_triangle({-reach, -reach, 0}, {2 * reach, -reach, 0}, {-reach, 2 * reach, 0});
        const Eigen::AlignedBox3f used(Vec3(-2, 1, -1), Vec3(3, 4, 1));
        const PatchGrid grid(scene, 0.1f, used);
        EXPECT_LT(grid.patch_count(), 2u * 60 * 40) << reach;
        Rng rng(3, 0);
        for (int k = 0; k < 2000; ++k) {
            const Vec3 x(-2 + 5 * rng.uniform(), 1 + 3 * rng.uniform(), 0);
            Hit hit;
            hit.distance = 1.0f;
            hit.primitive = 0;
            hit.u = (x.x() + reach) / (3 * reach);
            hit.v = (x.y() + reach) / (3 * reach);
            hit.back_side = k % 2 == 1;
            const std::uint32_t patch = grid.patch_of(hit);
            ASSERT_LT(patch, grid.patch_count());
            ASSERT_EQ(patch, grid.patch_of(grid.center(patch)));
            ASSERT_LT((place(scene, hit) - place(scene, grid.center(patch))).norm(), 0.12f) << reach;
        }
        Hit outside;
        outside.primitive = 0;
        for (const float u : {0.0f, 0.999f}) { // counts to the border
            outside.u = u;
            ASSERT_LT(grid.patch_of(outside), grid.patch_count());
        }
    }
}

TEST(PatchGrid, NeedsFewCellsForATerrainAroundARoom) {
    // Triangles of 50 m, which alone are not too large for cells of 10 cm each.
    Scene scene;
    for (int y = -10; y < 10; ++y)
        for (int x = -10; x < 10; ++x) {
            const Vec3 corner(50.0f * static_cast<float>(x), 50.0f * static_cast<float>(y), 0.0f);
            add_quad(scene, {corner, corner + Vec3(50, 0, 0), corner + Vec3(50, 50, 0), corner + Vec3(0, 50, 0)});
        }
    const Eigen::AlignedBox3f used(Vec3(-3, -2, -1), Vec3(2, 3, 1));
    const PatchGrid grid(scene, 0.1f, used);
    EXPECT_LT(grid.patch_count(), 2u * (2 * 60 * 60 + 800));
}

TEST(PatchGrid, KnowsAreasInAnyUnit) {
    for (const float size : {1e-10f, 1.0f, 1e10f}) {
        const Scene scene = single_triangle({0, 0, 0}, {size, 0, 0}, {0, size, 0});
        const PatchGrid grid(scene, 0.3f * size);
        double sum = 0.0;
        for (std::uint32_t patch = 0; patch < grid.patch_count(); patch += 2) sum += grid.area(patch);
        EXPECT_NEAR(sum / (static_cast<double>(size) * size), 0.5, 1e-4) << size;
    }
}

/// The unit square as n x n x 2 triangles, bent up along x = 1/2, two materials in y.
Scene bent_sheet(int n) {
    Scene scene;
    scene.materials = {{}, {}};
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x) {
            const float u = static_cast<float>(x) / static_cast<float>(n), v = static_cast<float>(y) / static_cast<float>(n);
            scene.positions.push_back({std::min(u, 0.5f), v, std::max(0.0f, u - 0.5f)});
        }
    const auto row = static_cast<std::uint32_t>(n) + 1;
    for (std::uint32_t q = 0; q < row * row - row; ++q) {
        if (q % row == row - 1) continue;
        for (const Triangle& t : {Triangle{q, q + 1, q + row + 1}, Triangle{q, q + row + 1, q + row}}) {
            scene.triangles.push_back(t);
            scene.material_index.push_back(2 * (q / row) < row - 1 ? 0 : 1);
        }
    }
    return scene;
}

TEST(PatchGrid, NeedsNoMoreCellsThanTheSurfaceHoweverFineItsTriangles) {
    std::uint32_t coarse = 0;
    for (const int n : {40, 200}) {
        const Scene scene = bent_sheet(n);
        const PatchGrid grid(scene, 0.1f);
        // Cubes of 0.075: 14 across, and one more where the sheet bends or the material changes.
        EXPECT_LE(grid.patch_count() / 2, 16u * 16u) << n;
        if (coarse != 0) {
            EXPECT_NEAR(grid.patch_count(), coarse, 0.1 * coarse);
        }
        coarse = grid.patch_count();
        expect_centres_close_to_their_hits(scene, 0.1f, "bent sheet");
        const Surface surface(scene);
        Rng rng(5, 0);
        for (int k = 0; k < 5000; ++k) {
            const Hit hit = random_hit(static_cast<std::uint32_t>(rng.next() % scene.triangles.size()), rng);
            const Hit centre = grid.center(grid.patch_of(hit));
            EXPECT_EQ(scene.material_index[hit.primitive], scene.material_index[centre.primitive]);
            EXPECT_GT(surface.geometric_normal(hit).dot(surface.geometric_normal(centre)), 0.9f);
        }
    }
}

TEST(PatchGrid, GivesEachSideOfASceneItsArea) {
    for (const char* name : {"builtin:cornell", "builtin:two_rooms", "builtin:sphere:0.5"}) {
        const Scene scene = make_builtin_scene(name);
        double area = 0.0;
        for (const Triangle& t : scene.triangles)
            area += 0.5
                    * (scene.positions[t[1]] - scene.positions[t[0]])
                          .cross(scene.positions[t[2]] - scene.positions[t[0]])
                          .cast<double>()
                          .norm();
        for (const float size : {0.03f, 0.11f, 10.0f}) {
            const PatchGrid grid(scene, size);
            double sides[2] = {};
            for (std::uint32_t patch = 0; patch < grid.patch_count(); ++patch) {
                EXPECT_GE(grid.area(patch), 0.0f);
                sides[patch % 2] += grid.area(patch);
            }
            EXPECT_NEAR(sides[0], area, 1e-4 * area) << name;
            EXPECT_NEAR(sides[1], area, 1e-4 * area) << name;
        }
    }
}

TEST(PatchGrid, KnowsTheAreaOfEachPatch) {
    // Places uniform on a triangle fall into patches in proportion to their areas.
    const Scene scene = single_triangle({0, 0, 0}, {1, 0, 0}, {0.3f, 0.6f, 0});
    const PatchGrid grid(scene, 0.21f);
    constexpr int count = 200'000;
    Rng rng(4, 0);
    std::map<std::uint32_t, int> hits;
    for (int k = 0; k < count; ++k)
        ++hits[grid.patch_of(random_hit(0, rng))];
    EXPECT_GT(hits.size(), 20u);
    for (std::uint32_t patch = 0; patch < grid.patch_count(); ++patch) {
        const double share = grid.area(patch) / (2.0 * 0.3);
        const double error = std::sqrt(share * (1.0 - share) / count);
        EXPECT_NEAR(hits[patch] / static_cast<double>(count), share, 4.0 * error + 1e-7)
            << "patch " << patch;
    }
}

TEST(PatchGrid, DrawsTheCornersInSoThatTheyLieInTheirPatch) {
    // Where the third edge cuts a corner off, what is left has it on that edge.
    const Scene scene = single_triangle({0, 0, 0}, {1, 0, 0}, {0.3f, 0.6f, 0});
    const PatchGrid grid(scene, 0.21f);
    int whole = 0;
    for (std::uint32_t patch = 0; patch < grid.patch_count(); ++patch) {
        if (!(grid.area(patch) > 1e-6f)) continue;
        const Hit centre = grid.center(patch);
        float farthest_u = 0.0f, farthest_v = 0.0f;
        for (const Hit& corner : grid.corners(patch)) {
            EXPECT_EQ(corner.primitive, centre.primitive);
            EXPECT_EQ(corner.back_side, centre.back_side);
            EXPECT_LE(corner.u + corner.v, 1.0f);
            farthest_u = std::max(farthest_u, std::abs(corner.u - centre.u));
            farthest_v = std::max(farthest_v, std::abs(corner.v - centre.v));
        }
        // Five columns by four rows.
        if (grid.area(patch) < 0.99f * 0.6f / 20.0f) continue;
        ++whole;
        for (const Hit& corner : grid.corners(patch)) EXPECT_EQ(grid.patch_of(corner), patch);
        EXPECT_NEAR(farthest_u, 0.98f * 0.1f, 1e-4f);
        EXPECT_NEAR(farthest_v, 0.98f * 0.125f, 1e-4f);
    }
    EXPECT_GT(whole, 4);
}

} // namespace
} // namespace afterglow
