#include "basis/push.h"
#include "core/builtin_scenes.h"
#include "core/sampling.h"

#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

struct Example {
    Scene scene = make_builtin_scene("builtin:cornell");
    Surface surface{scene};
    PointHierarchy points;
    PushOperator push;

    Example() {
        CandidateSource source(surface, {*scene.viewpoint}, 1);
        points = build_hierarchy(source, {.coarse_radius = 0.16f, .levels = 4, .shape = {}});
        push = make_push_operator(ShepardBasis(points, surface, true));
    }
};

const Example& example() {
    static const Example made;
    return made;
}

std::vector<float> random_values(std::size_t count, std::uint64_t seed) {
    Rng rng(seed, 0);
    std::vector<float> values(count);
    for (float& v : values)
        v = rng.uniform() - 0.3f;
    return values;
}

TEST(PushOperator, AddsWhatTheLevelAboveOfEachPointPredicts) {
    const auto& [scene, surface, points, push] = example();
    for (const int levels : {1, 2, 4}) {
        const std::vector<float> coefficients = random_values(3 * points.size(), 1);
        std::vector<float> values = coefficients;
        push.push(points, levels, 3, values);
        std::vector<double> expected(coefficients.begin(), coefficients.end());
        for (Index i = points.begin(0); i < points.end(levels - 1); ++i)
            for (std::size_t e = 0; e < push.parents.indices(i).size(); ++e)
                for (int c = 0; c < 3; ++c)
                    expected[3 * i + c] += static_cast<double>(push.parents.values(i)[e])
                                           * expected[3 * push.parents.indices(i)[e] + c];
        for (std::size_t k = 0; k < values.size(); ++k)
            ASSERT_NEAR(values[k], expected[k], 1e-5) << k;
    }
}

TEST(PushOperator, HasParentsOnTheLevelAboveThatSumToOne) {
    const auto& [scene, surface, points, push] = example();
    const ShepardBasis basis(points, surface, true);
    int orphans = 0;
    std::vector<BasisEntry> row;
    for (int l = 0; l < points.levels(); ++l)
        for (Index i = points.begin(l); i < points.end(l); ++i) {
            const auto index = push.parents.indices(i);
            if (l == 0) {
                ASSERT_TRUE(index.empty());
                continue;
            }
            orphans += index.empty();
            row.clear();
            basis.evaluate_or_nearest(l - 1, points.point(i), row);
            ASSERT_EQ(row.size(), index.size());
            float sum = 0.0f;
            for (std::size_t e = 0; e < index.size(); ++e) {
                EXPECT_EQ(index[e], row[e].index);
                EXPECT_EQ(push.parents.values(i)[e], row[e].value);
                sum += push.parents.values(i)[e];
            }
            if (!index.empty()) {
                EXPECT_NEAR(sum, 1.0f, 1e-5f);
            }
        }
    EXPECT_LT(orphans, 0.002 * points.size());
}

TEST(PushOperator, DifferenceIsItsInverse) {
    const auto& [scene, surface, points, push] = example();
    for (const int channels : {1, 3, 9})
        for (const int levels : {1, 3, 4}) {
            const std::vector<float> values = random_values(channels * points.size(), 2);
            std::vector<float> there = values;
            push.difference(points, levels, channels, there);
            if (levels > 1) {
                EXPECT_NE(there, values);
            }
            push.push(points, levels, channels, there);
            std::vector<float> back = values;
            push.push(points, levels, channels, back);
            push.difference(points, levels, channels, back);
            for (std::size_t k = 0; k < values.size(); ++k) {
                ASSERT_NEAR(there[k], values[k], 1e-5f);
                ASSERT_NEAR(back[k], values[k], 1e-5f);
            }
        }
}

TEST(PushOperator, CarriesConstantsFromTheCoarsestLevelDown) {
    const auto& [scene, surface, points, push] = example();
    std::vector<float> values(points.size(), 0.0f);
    std::vector<char> covered(points.size(), 0);
    for (std::uint32_t i = 0; i < points.size(); ++i) {
        const auto index = push.parents.indices(i);
        if (i < points.end(0)) {
            values[i] = 1.0f;
            covered[i] = 1;
        } else if (!index.empty()) {
            covered[i] = 1;
            for (const std::uint32_t k : index)
                covered[i] &= covered[k];
        }
    }
    push.push(points, points.levels(), 1, values);
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
        if (!covered[i]) continue;
        ++count;
        ASSERT_NEAR(values[i], 1.0f, 2e-5f);
    }
    EXPECT_GT(count, 0.99 * points.size());
}

/// The area of each function of coarser levels as the header defines it, in double precision.
std::vector<double> masses(const PointHierarchy& points, const PushOperator& push, int levels,
                           const std::vector<float>& area, std::vector<char>& has_children) {
    std::vector<double> mass(points.end(levels - 1), 0.0);
    has_children.assign(mass.size(), 0);
    for (int l = levels - 1; l >= 0; --l)
        for (Index i = points.begin(l); i < points.end(l); ++i) {
            if (!has_children[i]) mass[i] = area[i];
            for (std::size_t e = 0; e < push.parents.indices(i).size(); ++e) {
                mass[push.parents.indices(i)[e]] += mass[i] * push.parents.values(i)[e];
                has_children[push.parents.indices(i)[e]] = 1;
            }
        }
    return mass;
}

TEST(PullOperator, KeepsTheTotalFromLevelToLevel) {
    const auto& [scene, surface, points, push] = example();
    const int levels = 3;
    std::vector<float> area = random_values(points.end(levels - 1), 3);
    for (float& a : area)
        a += 0.4f; // positive
    std::vector<float> values = random_values(3 * points.end(levels - 1), 4);
    PullOperator(points, push, levels, area).pull(points, 3, values);

    std::vector<char> has_children;
    const std::vector<double> mass = masses(points, push, levels, area, has_children);
    for (int l = 0; l + 1 < levels; ++l)
        for (int c = 0; c < 3; ++c) {
            double above = 0.0, below = 0.0;
            for (Index i = points.begin(l); i < points.end(l); ++i)
                if (has_children[i]) above += mass[i] * values[3 * i + c];
            for (Index i = points.begin(l + 1); i < points.end(l + 1); ++i)
                if (!push.parents.indices(i).empty()) below += mass[i] * values[3 * i + c];
            EXPECT_NEAR(above, below, 1e-5 * std::abs(below)) << "level " << l;
        }
}

TEST(PullOperator, LeavesConstantsAndTheFinestLevelAlone) {
    const auto& [scene, surface, points, push] = example();
    const int levels = 3;
    const std::vector<float> area(points.end(levels - 1), 0.3f);
    const PullOperator pull(points, push, levels, area);
    std::vector<float> constant(points.end(levels - 1), 2.5f);
    pull.pull(points, 1, constant);
    for (const float v : constant)
        ASSERT_NEAR(v, 2.5f, 1e-5f);

    const std::vector<float> before = random_values(points.end(levels - 1), 5);
    std::vector<float> after = before;
    pull.pull(points, 1, after);
    for (Index i = points.begin(levels - 1); i < points.end(levels - 1); ++i)
        ASSERT_EQ(after[i], before[i]);
}

TEST(PullOperator, WeighsChildrenByTheirAreas) {
    // Three functions above four: 3 belongs to 0, a quarter of 4 to 0 and the rest to 1, 6 to 1;
    // nobody covers 5, and 2 has no children.
    PointHierarchy points;
    points.level_begin = {0, 3, 7};
    points.spacing = {1.0f, 0.5f};
    PushOperator push;
    push.parents =
        join_rows<float>({{}, {}, {}, {{0, 1.0f}}, {{0, 0.25f}, {1, 0.75f}}, {}, {{1, 1.0f}}});
    const std::vector<float> area{99, 99, 7, 2, 4, 5, 1};
    std::vector<float> values{-1, -2, -3, 10, 20, 30, 40};
    PullOperator(points, push, 2, area).pull(points, 1, values);
    EXPECT_FLOAT_EQ(values[0], (2 * 10 + 1 * 20) / 3.0f);
    EXPECT_FLOAT_EQ(values[1], (3 * 20 + 1 * 40) / 4.0f);
    EXPECT_FLOAT_EQ(values[2], -3.0f);
    EXPECT_FLOAT_EQ(values[5], 30.0f);
}

} // namespace
} // namespace afterglow
