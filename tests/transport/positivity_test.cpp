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

TEST(MakePositive, LeavesNothingBelowZeroAndTheLightBelowEachParentAsItWas) {
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

    Eigen::Array3Xd before = Eigen::Array3Xd::Zero(3, points.begin(last)), after = before;
    int raised = 0;
    for (std::uint32_t j = points.begin(last); j < points.end(last); ++j) {
        const Rgb was = irradiance(points, field, j), is = irradiance(points, limited, j);
        EXPECT_TRUE((is >= -1e-6f).all()) << "point " << j;
        raised += (was < 0.0f).any();
        const auto index = small.transfer.push.parents.indices(j);
        const auto weight = small.transfer.push.parents.values(j);
        for (std::size_t e = 0; e < index.size(); ++e) {
            before.col(index[e]) += (weight[e] * was).cast<double>();
            after.col(index[e]) += (weight[e] * is).cast<double>();
        }
    }
    EXPECT_GT(raised, 50);
    // All of it, and what each parent passes on; where several parents share a point their shares mix.
    EXPECT_NEAR(after.sum(), before.sum(), 1e-4 * before.sum());
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
