#include "basis/push.h"
#include "core/builtin_scenes.h"
#include "tests/support/random_values.h"

#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

struct PushExample {
    Scene scene = make_builtin_scene("builtin:cornell");
    Surface surface{scene};
    PointHierarchy points;
    PushOperator push;

    PushExample() {
        CandidateSource source(surface, {*scene.viewpoint}, 1);
        points = build_hierarchy(source, {.coarse_radius = 0.16f,
                                          .levels = 3,
                                          .display = DisplayLevel{0.03f, 1}});
        push = make_push_operator(ShepardBasis(points, surface, true));
    }
};

const PushExample& push_example() {
    static const PushExample made;
    return made;
}

TEST(PushOperator, AddsWhatTheLevelAboveOfEachPointPredicts) {
    const auto& [scene, surface, points, push] = push_example();
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
    const auto& [scene, surface, points, push] = push_example();
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
            basis.evaluate_or_nearest(points.parent_level[l], points.point(i), row);
            drop_small_shares(row);
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
    const auto& [scene, surface, points, push] = push_example();
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
    const auto& [scene, surface, points, push] = push_example();
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

TEST(PullOperator, AveragesChildrenFromFineToCoarse) {
    // 0 and 1 above 2 and 3, these above 4 and 5; 1 and 3 have no children.
    PointHierarchy points;
    points.level_begin = {0, 2, 4, 6};
    points.spacing = {1.0f, 0.5f, 0.25f};
    const PullOperator pull{
        join_rows<float>({{{2, 0.25f}, {3, 0.75f}}, {}, {{4, 0.5f}, {5, 0.5f}}, {}})};
    std::vector<float> values{-1, -10, -2, -20, -3, -30, 8, 80, 1, 10, 3, 30};
    pull.pull(points, 3, 2, values);
    EXPECT_EQ(values, (std::vector<float>{6.5f, 65, -2, -20, 2, 20, 8, 80, 1, 10, 3, 30}));
}

TEST(PullOperator, UpdatesCoarseCoefficientsByTheMeanOfFinerOnes) {
    PointHierarchy points;
    points.level_begin = {0, 2, 4, 6};
    points.spacing = {1.0f, 0.5f, 0.25f};
    const PullOperator pull{
        join_rows<float>({{{2, 0.25f}, {3, 0.75f}}, {}, {{4, 0.5f}, {5, 0.5f}}, {}})};
    std::vector<float> c{1, 10, 2, 20, 3, 30, 8, 80, 1, 10, 3, 30};
    pull.update(points, 3, 2, c);
    // Function 2 gets the mean of 4 and 5, 2; function 0 a quarter of the new 2 and 3/4 of 3.
    EXPECT_EQ(c, (std::vector<float>{8.25f, 82.5f, 2, 20, 5, 50, 8, 80, 1, 10, 3, 30}));
}

} // namespace
} // namespace afterglow
