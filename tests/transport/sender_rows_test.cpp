#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/support/gather_oracle.h"
#include "tests/support/quad.h"
#include "tests/support/surface_samples.h"
#include "transport/precompute.h"
#include "transport/sender_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

namespace afterglow {
namespace {

struct RowsExample {
    Scene scene;
    Surface surface;
    PointHierarchy points;
    ShepardBasis basis;

    explicit RowsExample(const std::string& name, float coarse_radius, float finest_density = 0.0f)
        : scene(make_builtin_scene(name)), surface(scene),
          points(make_points(surface, coarse_radius, finest_density)), basis(points, surface, true) {}

    static PointHierarchy make_points(const Surface& surface, float coarse_radius, float finest_density) {
        CandidateSource source(surface, {*surface.scene().viewpoint}, 1);
        HierarchyOptions options;
        options.coarse_radius = coarse_radius;
        options.levels = 3;
        options.finest_density = finest_density;
        return build_hierarchy(source, options);
    }
};

/// Hits all over the front sides: `count` a triangle, random.
std::vector<Hit> hits_on_fronts(const Scene& scene, int count, std::uint64_t seed) {
    Rng rng(seed, 0);
    std::vector<Hit> hits;
    for (std::uint32_t t = 0; t < scene.triangles.size(); ++t)
        for (int k = 0; k < count; ++k) {
            const float s = std::sqrt(rng.uniform()), r = rng.uniform();
            Hit hit;
            hit.distance = 1.0f;
            hit.primitive = t;
            hit.u = s * (1.0f - r);
            hit.v = s * r;
            hits.push_back(hit);
        }
    return hits;
}

std::vector<std::uint32_t> numbers_of(const SenderRows& rows, const std::vector<Hit>& hits) {
    std::vector<std::uint32_t> numbers;
    for (const Hit& hit : hits)
        for (int level = 0; level < rows.levels(); ++level)
            numbers.push_back(rows.number(hit, level));
    return numbers;
}

bool equal(std::span<const BasisEntry> a, std::span<const BasisEntry> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](auto& x, auto& y) { return x.index == y.index && x.value == y.value; });
}

TEST(SenderRows, AreTheBasisAtTheCentresOfTheirPatches) {
    const RowsExample example("builtin:cornell", 0.2f);
    SenderRows rows(example.surface, example.basis, 3, 0.25f);
    const std::vector<Hit> hits = hits_on_fronts(example.scene, 300, 2);
    rows.require(numbers_of(rows, hits));
    std::size_t empty = 0;
    for (int level = 0; level < 3; ++level) {
        const PatchGrid grid(example.scene, 0.25f * example.points.spacing[level]);
        for (const Hit& hit : hits) {
            const Hit center = grid.center(grid.patch_of(hit));
            const SurfacePoint x = example.surface.point(center);
            const auto row = rows.row(rows.number(hit, level));
            empty += row.empty();
            float sum = 0.0f;
            for (const BasisEntry& entry : row) {
                EXPECT_GT(entry.value, 0.0f);
                EXPECT_LT(entry.index, example.points.end(level));
                sum += entry.value;
            }
            if (row.empty()) continue;
            ASSERT_NEAR(sum, 1.0f, 1e-5f);
            std::vector<BasisEntry> expected;
            example.basis.evaluate_or_nearest(level, x, expected);
            for (int l = level - 1; l >= 0 && expected.empty(); --l)
                example.basis.evaluate(l, x, expected);
            if (level == 2)
                weigh_by_reflectance(example.points, example.surface.reflectance(center), expected);
            const bool undecided =
                std::any_of(expected.begin(), expected.end(), [](const BasisEntry& entry) {
                    return std::abs(entry.value - 0.05f) < 1e-4f; // the share that drops out
                });
            if (undecided) continue;
            drop_small_shares(expected);
            ASSERT_EQ(row.size(), expected.size()) << "at " << x.position.transpose();
            for (std::size_t k = 0; k < row.size(); ++k) {
                EXPECT_EQ(row[k].index, expected[k].index);
                EXPECT_NEAR(row[k].value, expected[k].value, 1e-4f);
            }
        }
    }
    EXPECT_LT(empty, 0.001 * 3 * hits.size());
    EXPECT_LE(rows.uncovered(), empty);
}

TEST(SenderRows, KeepReflectancesApartOnTheFinestLevel) {
    // A ground of two triangles, white where x + z > 0, black elsewhere, under two like levels.
    Scene scene = make_ground(1.0f);
    scene.materials.resize(2);
    scene.materials[0].reflectance.setConstant(0.8f);
    scene.materials[1].reflectance.setConstant(0.05f);
    scene.material_index = {0, 1};
    const Surface surface(scene);
    constexpr int side = 20, count = side * side;
    PointHierarchy points;
    points.position.resize(3, 2 * count);
    points.reflectance.resize(3, 2 * count);
    for (int i = 0; i < 2 * count; ++i) {
        const Vec2 place = Vec2(i % side + 0.5f, i % count / side + 0.7f) * (2.0f / side);
        points.position.col(i) = Vec3(place.x() - 1.0f, 0.0f, place.y() - 1.0f);
        points.reflectance.col(i).setConstant(place.sum() > 2.0f ? 0.8f : 0.05f);
    }
    points.normal = Vec3::UnitY().replicate(1, 2 * count);
    points.support = Eigen::VectorXf::Constant(2 * count, 0.25f);
    points.level_begin = {0, count, 2 * count};
    points.spacing = {0.1f, 0.1f};
    points.parent_level = {-1, 0};
    const ShepardBasis basis(points, surface, true);
    SenderRows rows(surface, basis, 2);
    const std::vector<Hit> hits = hits_on_fronts(scene, 2000, 2);
    rows.require(numbers_of(rows, hits));
    float other[2] = {0.0f, 0.0f}; // the largest share of the other kind, a level
    for (const Hit& hit : hits)
        for (int level = 0; level < 2; ++level) {
            float share = 0.0f;
            for (const BasisEntry& entry : rows.row(rows.number(hit, level)))
                if ((points.reflectance(0, entry.index) > 0.5f) != (hit.primitive == 0))
                    share += entry.value;
            other[level] = std::max(other[level], share);
        }
    EXPECT_GT(other[0], 0.4f);
    EXPECT_EQ(other[1], 0.0f); // one part in a thousand is a share that drops out
}

TEST(SenderRows, KeepTheSidesOfAWallApart) {
    // A wall stands on one ground: a sheet through its patches, or as thick as a third of one so that
    // some have their centre in it.
    for (const float thickness : {0.0f, 0.02f}) {
        const float left = thickness == 0.0f ? 0.011f : 0.0f;
        const float right = left + thickness;
        Scene scene = make_ground(1.0f);
        for (const float x : {left, right})
            add_quad(scene, {Vec3(x, 0, -1), Vec3(x, 1, -1), Vec3(x, 1, 1), Vec3(x, 0, 1)});
        const Surface surface(scene);
        constexpr int side = 20, count = side * side;
        PointHierarchy points;
        points.position.resize(3, count);
        for (int i = 0; i < count; ++i)
            points.position.col(i) =
                Vec3(0.1f * (i % side) - 0.945f, 0.0f, 0.1f * (i / side) - 0.95f);
        points.normal = Vec3::UnitY().replicate(1, count);
        points.support = Eigen::VectorXf::Constant(count, 0.25f);
        points.reflectance = Eigen::Matrix3Xf::Constant(3, count, 0.5f);
        points.level_begin = {0, count};
        points.spacing = {0.1f};
        points.parent_level = {-1};
        const ShepardBasis basis(points, surface, true);
        const auto hits_beside_wall = [&](std::uint64_t seed) {
            std::vector<Hit> hits = hits_on_fronts(scene, 20'000, seed);
            std::erase_if(hits, [&](const Hit& hit) {
                const float x = surface.point(hit).position.x();
                return hit.primitive > 1 || (left < x && x < right);
            });
            return hits;
        };
        const std::vector<Hit> hits = hits_beside_wall(2);
        const auto wrong = [&](SenderRows& rows) {
            rows.require(numbers_of(rows, hits));
            return std::count_if(hits.begin(), hits.end(), [&](const Hit& hit) {
                const float x = surface.point(hit).position.x();
                const auto row = rows.row(rows.number(hit, 0));
                EXPECT_FALSE(row.empty());
                return std::any_of(row.begin(), row.end(), [&](const BasisEntry& entry) {
                    return (points.position(0, entry.index) > right) != (x > right);
                });
            });
        };
        SenderRows blind(surface, basis, 1), seeing(surface, basis, 1);
        seeing.see(hits_beside_wall(3));
        // Of the last there are only corners of triangles so small that no ray was counted there.
        EXPECT_GT(wrong(blind), 150) << "of " << hits.size();
        EXPECT_LT(wrong(seeing), 20) << "of " << hits.size();
    }
}

TEST(SenderRows, AreTheSameInWhateverOrderTheyAreMade) {
    const RowsExample example("builtin:cornell", 0.2f);
    SenderRows bit_by_bit(example.surface, example.basis, 3), at_once = bit_by_bit;
    std::vector<std::uint32_t> numbers = numbers_of(at_once, hits_on_fronts(example.scene, 50, 3));
    at_once.require(numbers);
    // With repetitions and rays that left the scene.
    std::vector<std::uint32_t> again(numbers.rbegin(), numbers.rend());
    again.push_back(no_index);
    for (std::size_t first = 0; first < again.size(); first += 100)
        bit_by_bit.require(
            std::span(again).subspan(first, std::min<std::size_t>(150, again.size() - first)));
    std::sort(numbers.begin(), numbers.end());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    EXPECT_EQ(at_once.made(), numbers.size());
    EXPECT_EQ(bit_by_bit.made(), numbers.size());
    for (const std::uint32_t n : numbers)
        ASSERT_TRUE(equal(at_once.row(n), bit_by_bit.row(n)));
}

TEST(SenderRows, PullWithoutLosingLight) {
    // Sums over the rays that were counted: of what each level shows them, whatever is pulled.
    const RowsExample example("builtin:cornell", 0.2f);
    constexpr int levels = 3;
    SenderRows rows(example.surface, example.basis, levels, 0.25f);
    const std::vector<Hit> hits = hits_on_fronts(example.scene, 20'000, 4);
    rows.see(hits);
    const PullOperator pull = rows.make_pull_operator();
    ASSERT_EQ(pull.children.rows(), example.points.begin(levels - 1));

    std::vector<float> values(example.points.end(levels - 1), 0.0f);
    Rng rng(5, 0);
    for (std::uint32_t i = example.points.begin(levels - 1); i < values.size(); ++i)
        values[i] = example.points.position(0, i) < 0.2f ? 1.0f + rng.uniform() : 0.1f;
    pull.pull(example.points, levels, 1, values);
    rows.require(numbers_of(rows, hits));
    std::vector<double> shown(levels, 0.0);
    // At the finest patches' centres, where the integrals are taken.
    const PatchGrid finest(example.scene, 0.25f * example.points.spacing[levels - 1]);
    for (const Hit& hit : hits) {
        const Hit centre = finest.center(finest.patch_of(hit));
        for (int l = 0; l < levels; ++l) {
            const std::uint32_t number = rows.number(centre, l);
            rows.require(std::span(&number, 1));
            for (const BasisEntry& entry : rows.row(number))
                shown[l] += entry.value * values[entry.index];
        }
    }
    // Children below a thousandth are left out.
    for (int l = 0; l + 1 < levels; ++l)
        EXPECT_NEAR(shown[l], shown[levels - 1], 5e-3 * shown[levels - 1]) << "level " << l;
}

TEST(SenderRows, PullConstantsToThemselves) {
    const RowsExample example("builtin:furnace", 0.5f);
    SenderRows rows(example.surface, example.basis, 3);
    rows.see(hits_on_fronts(example.scene, 5'000, 4));
    const PullOperator pull = rows.make_pull_operator();
    std::vector<float> values(example.points.end(2), 2.5f);
    pull.pull(example.points, 3, 1, values);
    for (const float v : values)
        ASSERT_NEAR(v, 2.5f, 1e-5f);
    EXPECT_GT(pull.children.entries(), 2 * example.points.begin(2));
}

TEST(SenderRows, FinestAreasAddUpToTheSurface) {
    const RowsExample example("builtin:furnace", 0.5f);
    SenderRows rows(example.surface, example.basis, 3);
    rows.require(numbers_of(rows, hits_on_fronts(example.scene, 20'000, 4)));
    const std::vector<float> areas = rows.finest_areas();
    ASSERT_EQ(areas.size(), example.points.end(2) - example.points.begin(2));
    double sum = 0.0;
    for (const float area : areas) {
        EXPECT_GT(area, 0.0f);
        sum += area;
    }
    EXPECT_NEAR(sum, 24.0, 0.01);
}

TEST(SenderRows, FinestAreasGlareNowhere) {
    // An area by patches' centres is to be compared with one by many places: never much less. Functions lie close
    // together at the edges.
    const RowsExample example("builtin:furnace", 0.8f, PrecomputeOptions{}.sender_density);
    SenderRows rows(example.surface, example.basis, 3);
    const std::vector<Hit> hits = hits_on_fronts(example.scene, 20'000, 5);
    const double area_of_hit = 24.0 / static_cast<double>(hits.size());
    rows.require(numbers_of(rows, hits));
    const std::vector<float> areas = rows.finest_areas();
    std::vector<double> true_area(areas.size());
    std::vector<BasisEntry> row;
    for (const Hit& hit : hits) {
        row.clear();
        sender_row(example.surface, example.basis, 2, hit, row);
        for (const BasisEntry& entry : row)
            if (entry.index >= example.points.begin(2))
                true_area[entry.index - example.points.begin(2)] += area_of_hit * entry.value;
    }
    int marked = 0;
    double sum = 0.0;
    for (std::uint32_t k = 0; k < areas.size(); ++k) {
        if (areas[k] != SenderRows::in_few_rows) {
            EXPECT_GT(areas[k], 0.3 * true_area[k]) << k;
            sum += areas[k];
            continue;
        }
        ++marked; // it lies on an edge, close to two walls
        Vec3 from_wall = Vec3::Ones() - Vec3(example.points.position.col(example.points.begin(2) + k).cwiseAbs());
        std::ranges::sort(from_wall);
        EXPECT_LT(from_wall[1], 0.25f * example.points.spacing[2]) << from_wall.transpose();
    }
    EXPECT_GT(marked, 0);
    EXPECT_NEAR(sum, 24.0, 0.01 * 24.0); // next to nothing went with them
}

TEST(SenderRows, LeaveFunctionsThatNoRayMetAsTheyAre) {
    const RowsExample example("builtin:furnace", 0.5f);
    SenderRows rows(example.surface, example.basis, 2);
    EXPECT_EQ(rows.make_pull_operator().children.entries(), 0u);
}

} // namespace
} // namespace afterglow
