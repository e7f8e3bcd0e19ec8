#include "basis/shepard_basis.h"
#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/support/quad.h"
#include "tests/support/shepard_oracle.h"
#include "tests/support/surface_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <memory>
#include <string>

namespace afterglow {
namespace {

/// A built-in scene with a small hierarchy over it: three levels, the last by openness.
struct BasisExample {
    Scene scene;
    Surface surface;
    PointHierarchy points;

    BasisExample(const std::string& name, float coarse_radius, BasisShape shape = {})
        : scene(make_builtin_scene(name)), surface(scene) {
        CandidateSource source(surface, find_viewpoints(surface, 1), 1);
        HierarchyOptions options;
        options.coarse_radius = coarse_radius;
        options.levels = 2;
        options.display = DisplayLevel{options.coarse_radius / 4.0f, 1};
        options.shape = shape;
        points = build_hierarchy(source, options);
    }
};

/// Places on the surfaces, every other one with a normal that is tilted as a normal map would.
std::vector<SurfacePoint> places(const Scene& scene, int count, std::uint64_t seed) {
    std::vector<SurfacePoint> all = points_by_area(scene, count, seed);
    Rng rng(seed, 1);
    for (std::size_t i = 0; i < all.size(); i += 2) {
        const float u = rng.uniform(), v = rng.uniform();
        all[i].normal = (all[i].normal + 0.5f * sample_sphere({u, v})).normalized();
    }
    return all;
}

float sum_of(const std::vector<BasisEntry>& row) {
    float sum = 0.0f;
    for (const BasisEntry& entry : row)
        sum += entry.value;
    return sum;
}

TEST(ShepardBasis, SumsToOneWhereItCoversAndIsNeverNegative) {
    for (const auto& [name, radius] :
         {std::pair("builtin:cornell", 0.12f), {"builtin:two_rooms", 1.0f}}) {
        const BasisExample example(name, radius);
        const ShepardBasis basis(example.points, example.surface, true);
        int covered = 0, all = 0;
        std::vector<BasisEntry> row;
        for (const SurfacePoint& x : places(example.scene, 2000, 5))
            for (int level = 0; level < 3; ++level) {
                row.clear();
                basis.evaluate(level, x, row);
                ++all;
                if (row.empty()) continue;
                ++covered;
                EXPECT_NEAR(sum_of(row), 1.0f, 1e-5f) << "at " << x.position.transpose();
                for (std::size_t k = 0; k < row.size(); ++k) {
                    EXPECT_GT(row[k].value, 0.0f);
                    EXPECT_GE(row[k].index, example.points.begin(level));
                    EXPECT_LT(row[k].index, example.points.end(level));
                    if (k > 0) {
                        EXPECT_LT(row[k - 1].index, row[k].index);
                    }
                }
            }
        EXPECT_GT(covered, 0.9 * all) << name;
    }
}

/// Compares every value with the formula, evaluated function by function.
void expect_formula(const BasisExample& example, bool see_walls, int count) {
    const ShepardBasis basis(example.points, example.surface, see_walls);
    std::vector<BasisEntry> row;
    int walls = 0, unlike = 0;
    for (const SurfacePoint& x : places(example.scene, count, 6))
        for (int level = 0; level < 3; ++level) {
            row.clear();
            basis.evaluate(level, x, row);
            const auto exact =
                shepard_by_formula(example.points, level, x, &example.surface, see_walls);
            if (exact.empty()) {
                EXPECT_TRUE(row.empty());
                continue;
            }
            double kept = 0.0;
            for (const BasisEntry& entry : row)
                if (const auto at = exact.find(entry.index); at != exact.end()) kept += at->second;
            auto left_out = exact;
            for (const BasisEntry& entry : row) {
                const auto at = exact.find(entry.index);
                const double value = at == exact.end() ? 0.0 : at->second;
                EXPECT_NEAR(entry.value, value / kept, 2e-5) << "at " << x.position.transpose();
                left_out.erase(entry.index);
            }
            // What the row leaves out hardly weighs anything.
            for (const auto& [j, value] : left_out)
                EXPECT_LT(value, see_walls ? 1.01e-3 : 1e-5) << "at " << x.position.transpose();
            EXPECT_GT(kept, see_walls ? 0.98 : 0.9999);
            if (see_walls)
                for (const auto& [j, value] : shepard_by_formula(example.points, level, x,
                                                                 &example.surface, false))
                    walls += value > 0.05 && !exact.contains(j);
            if (level == 2) {
                const auto blind = shepard_by_formula(example.points, level, x, nullptr);
                const auto alone = shepard_by_formula(example.points, level, x, &example.surface, false);
                for (const auto& [j, value] : blind)
                    unlike += std::abs(value - alone.at(j)) > 0.1;
            }
        }
    if (see_walls) {
        EXPECT_GT(walls, 5) << "no walls met: the test shows nothing";
    }
    EXPECT_EQ(example.points.openness_level, 2);
    EXPECT_GT(unlike, count / 10) << "openness hardly matters: the test shows nothing";
}

TEST(ShepardBasis, IsItsFormula) {
    const BasisExample example("builtin:cornell", 0.12f);
    expect_formula(example, false, 300);
    expect_formula(example, true, 300);
    expect_formula(BasisExample("builtin:cornell", 0.12f, BasisShape::paper()), false, 100);
}

TEST(ShepardBasis, GivesWhatStandsBehindAThinWallNextToNothing) {
    // Pillars against a wall's end: the door of two rooms. A wall 5 cm thick, supports of 1.5 m.
    const BasisExample example("builtin:two_rooms", 1.0f);
    const ShepardBasis blind(example.points, example.surface, false);
    const ShepardBasis seeing(example.points, example.surface, true);
    std::vector<BasisEntry> row;
    double leak_blind = 0.0, leak_seeing = 0.0;
    const auto leak = [&](const ShepardBasis& basis, const SurfacePoint& x) {
        row.clear();
        basis.evaluate(0, x, row);
        double sum = 0.0;
        bool any_in_sight = false;
        for (const BasisEntry& entry : row) {
            const bool wall = behind_a_wall(example.points, example.surface, x, entry.index);
            if (wall) sum += entry.value;
            any_in_sight |= !wall;
        }
        return any_in_sight ? sum : 0.0;
    };
    for (const SurfacePoint& x : points_by_area(example.scene, 3000, 7)) {
        // Floor and ceiling beside the wall, away from the door.
        if (std::abs(x.position.x() - 4.025f) > 0.6f || std::abs(x.normal.y()) < 0.5f) continue;
        leak_blind += leak(blind, x);
        leak_seeing += leak(seeing, x);
    }
    EXPECT_GT(leak_blind, 10.0);
    EXPECT_LT(leak_seeing, 2e-2 * leak_blind);
}

TEST(ShepardBasis, SeesASheetThatLiesCloserThanItsLift) {
    // A sheet a millimetre above the ground, over x > 0; functions at x = -0.3 and 0.5, the point
    // between them below the sheet: the line of sight to the first meets the sheet's edge, though
    // walls are looked for two centimetres above open ground.
    Scene scene = make_ground(10.0f);
    add_quad(scene, {Vec3(0, 1e-3f, -1), Vec3(0, 1e-3f, 1), Vec3(2, 1e-3f, 1), Vec3(2, 1e-3f, -1)});
    const Surface surface(scene);
    PointHierarchy points;
    points.position.resize(3, 2);
    points.position << -0.3f, 0.5f, 0.0f, 0.0f, 0.0f, 0.0f;
    points.normal = Vec3::UnitY().replicate(1, 2);
    points.support = Eigen::VectorXf::Constant(2, 1.0f);
    points.level_begin = {0, 2};
    points.spacing = {0.7f};
    points.parent_level = {-1};
    const ShepardBasis basis(points, surface, true);
    std::vector<BasisEntry> row;
    basis.evaluate(0, {Vec3(0.1f, 0.0f, 0.0f), Vec3::UnitY()}, row);
    ASSERT_EQ(row.size(), 1u);
    EXPECT_EQ(row[0].index, 1u);
    // On open ground beside the sheet it is the other way round.
    row.clear();
    basis.evaluate(0, {Vec3(-0.1f, 0.0f, 0.0f), Vec3::UnitY()}, row);
    ASSERT_EQ(row.size(), 1u);
    EXPECT_EQ(row[0].index, 0u);
}

TEST(ShepardBasis, TakesTheClosestFunctionInSightWhereNoneCovers) {
    const BasisExample example("builtin:two_rooms", 1.0f);
    // Supports so short that hardly anything is covered.
    PointHierarchy sparse = example.points;
    sparse.support *= 0.1f;
    const ShepardBasis basis(sparse, example.surface, true);
    std::vector<BasisEntry> row;
    int filled = 0, walls_avoided = 0;
    for (const SurfacePoint& x : points_by_area(example.scene, 2000, 8)) {
        row.clear();
        basis.evaluate(1, x, row);
        if (!row.empty()) continue;
        basis.evaluate_or_nearest(1, x, row);
        if (row.empty()) continue;
        ++filled;
        ASSERT_EQ(row.size(), 1u);
        EXPECT_EQ(row[0].value, 1.0f);
        const std::uint32_t chosen = row[0].index;
        EXPECT_FALSE(behind_a_wall(sparse, example.surface, x, chosen));
        EXPECT_GT(x.normal.dot(sparse.normal.col(chosen)), 0.0f);
        // Nothing closer faces the same way in sight.
        const float distance = (sparse.position.col(chosen) - x.position).norm();
        for (std::uint32_t j = sparse.begin(1); j < sparse.end(1); ++j) {
            if ((sparse.position.col(j) - x.position).norm() > 0.9999f * distance) continue;
            if (x.normal.dot(sparse.normal.col(j)) <= 0.1f) continue;
            EXPECT_TRUE(behind_a_wall(sparse, example.surface, x, j));
            ++walls_avoided;
        }
    }
    EXPECT_GT(filled, 1000);
    EXPECT_GT(walls_avoided, 0) << "the closest was always in sight: the test shows nothing";
}

TEST(ShepardBasis, FactorsFoundAtAPlaceMakeItsRow) {
    const BasisExample example("builtin:cornell", 0.12f);
    const ShepardBasis basis(example.points, example.surface, true);
    std::vector<BasisEntry> factors, row, expected;
    int nearest = 0;
    for (const SurfacePoint& x :
         points_in_sight(example.surface, *example.scene.viewpoint, 2000, 8))
        for (int level = 0; level < 3; ++level)
            // Within a reach there are more functions, which weigh nothing here.
            for (const float reach : {0.0f, 0.2f * example.points.spacing[level]}) {
                factors.clear();
                row.clear();
                expected.clear();
                basis.factors(level, x, reach, factors);
                basis.apply_factors(factors, x, row);
                basis.evaluate_or_nearest(level, x, expected);
                nearest += expected.size() == 1;
                float difference = 0.0f;
                std::map<std::uint32_t, float> values;
                for (const BasisEntry& entry : row) values[entry.index] += entry.value;
                for (const BasisEntry& entry : expected) values[entry.index] -= entry.value;
                for (const auto& [j, value] : values) difference += std::abs(value);
                // Below 1e-3 of those in sight, functions are left out or not by their largest weight.
                EXPECT_LT(difference, reach == 0.0f ? 1e-5f : 0.02f) << "at " << x.position.transpose();
            }
    EXPECT_GT(nearest, 10) << "no place without functions: the test shows nothing";
}

TEST(ShepardBasis, AppendsToARow) {
    const BasisExample example("builtin:cornell", 0.12f);
    const ShepardBasis basis(example.points, example.surface, true);
    const SurfacePoint x = example.points.point(0);
    std::vector<BasisEntry> alone, behind{{7, 0.25f}};
    basis.evaluate(1, x, alone);
    basis.evaluate(1, x, behind);
    ASSERT_EQ(behind.size(), alone.size() + 1);
    EXPECT_EQ(behind[0].index, 7u);
    EXPECT_EQ(behind[0].value, 0.25f);
    for (std::size_t k = 0; k < alone.size(); ++k)
        EXPECT_EQ(behind[k + 1].value, alone[k].value);
}

TEST(DropSmallShares, KeepsTheRestInProportion) {
    std::vector<BasisEntry> row{{3, 0.6f}, {5, 0.04f}, {8, 0.3f}, {9, 0.02f}, {12, 0.04f}};
    drop_small_shares(row);
    ASSERT_EQ(row.size(), 2u);
    EXPECT_EQ(row[0].index, 3u);
    EXPECT_EQ(row[1].index, 8u);
    EXPECT_FLOAT_EQ(row[0].value, 2.0f / 3.0f);
    EXPECT_FLOAT_EQ(row[1].value, 1.0f / 3.0f);
    std::vector<BasisEntry> empty;
    drop_small_shares(empty);
    EXPECT_TRUE(empty.empty());
}

} // namespace
} // namespace afterglow
