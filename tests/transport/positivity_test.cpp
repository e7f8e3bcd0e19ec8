#include "transport/positivity.h"

#include "tests/support/small_transfer.h"

#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

Rgb irradiance(const PointHierarchy& points, const VectorIrradiance& field, std::uint32_t j) {
    Rgb e;
    for (int c = 0; c < 3; ++c)
        e[c] = points.normal.col(j).dot(Vec3(field[9 * j + c], field[9 * j + 3 + c], field[9 * j + 6 + c]));
    return e;
}

TEST(MakePositive, LeavesNothingBelowZeroAndAllTheLightThatThereIs) {
    const SmallTransfer& small = small_transfer();
    const PointHierarchy& points = small.transfer.points;
    const int last = points.levels() - 1;
    VectorIrradiance field(9 * points.size());
    // Waves, a tenth of them below zero, and something along the surface, too.
    for (std::uint32_t j = 0; j < points.size(); ++j)
        for (int a = 0; a < 3; ++a)
            for (int c = 0; c < 3; ++c)
                field[9 * j + 3 * a + c] = points.normal(a, j) * (1.0f + 1.05f * std::sin(40.0f * points.position(0, j) + c))
                                           + 0.3f * points.normal((a + 1) % 3, j);
    VectorIrradiance limited = field;
    make_positive(points, small.transfer.push, limited);

    // By the formula: what is missing below each parent, and what there is to take it from.
    const SparseRows<float>& parents = small.transfer.push.parents;
    Eigen::Array3Xd missing = Eigen::Array3Xd::Zero(3, points.begin(last)), there = missing;
    for (std::uint32_t j = points.begin(last); j < points.end(last); ++j)
        for (std::size_t e = 0; e < parents.indices(j).size(); ++e) {
            const Eigen::Array3d share = (parents.values(j)[e] * irradiance(points, field, j)).cast<double>();
            missing.col(parents.indices(j)[e]) += (-share).max(0.0);
            there.col(parents.indices(j)[e]) += share.max(0.0);
        }
    double before = 0.0, after = 0.0, not_there = 0.0;
    int raised = 0;
    for (std::uint32_t j = points.begin(last); j < points.end(last); ++j) {
        const Rgb was = irradiance(points, field, j), is = irradiance(points, limited, j);
        Eigen::Array3d taken = Eigen::Array3d::Zero();
        for (std::size_t e = 0; e < parents.indices(j).size(); ++e) {
            const std::uint32_t k = parents.indices(j)[e];
            taken += parents.values(j)[e] * (there.col(k) > 0.0).select(missing.col(k) / there.col(k), 0.0);
        }
        const Eigen::Array3d light = was.cast<double>().max(0.0);
        EXPECT_TRUE((is >= -1e-6f).all()) << "point " << j;
        EXPECT_LT((is.cast<double>() - light * (1.0 - taken.min(1.0))).abs().maxCoeff(), 1e-5) << "point " << j;
        raised += (was < 0.0f).any();
        before += was.sum(), after += is.sum();
        not_there += (light * (taken - 1.0).max(0.0)).sum();
    }
    EXPECT_GT(raised, 50);
    for (Index k = 0; k < there.cols(); ++k)
        not_there += (there.col(k) > 0.0).select(Eigen::Array3d::Zero(), missing.col(k)).sum();
    // No light is made but what is missing where there is too little to take it from.
    EXPECT_NEAR(after, before + not_there, 1e-5 * before);
    EXPECT_LT(not_there, 1e-3 * before);
    // Coarser levels are not touched.
    EXPECT_TRUE(std::equal(field.begin(), field.begin() + 9 * points.begin(last), limited.begin()));
}

TEST(MakePositive, DoesNothingWhereNothingIsNegative) {
    const SmallTransfer& small = small_transfer();
    VectorIrradiance field(9 * small.transfer.points.size());
    for (std::uint32_t j = 0; j < small.transfer.points.size(); ++j)
        for (int a = 0; a < 3; ++a) field[9 * j + 3 * a] = small.transfer.points.normal(a, j);
    VectorIrradiance same = field;
    make_positive(small.transfer.points, small.transfer.push, same);
    EXPECT_EQ(same, field);
}

} // namespace
} // namespace afterglow
