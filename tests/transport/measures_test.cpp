#include "core/error.h"
#include "transport/measures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace afterglow {
namespace {

TEST(Measures, EqualPicturesDoNotDiffer) {
    const Eigen::Array3Xf y = Eigen::Array3Xf::Random(3, 50).abs();
    const Measures m = measure(y, y);
    for (const double value : {m.rel_rmse, m.rel_l1, m.bias, m.median, m.p95, m.p99})
        EXPECT_EQ(value, 0.0);
    EXPECT_EQ(m.samples, 50);
}

TEST(Measures, AreWhatTheirFormulasSay) {
    Eigen::Array3Xf x(3, 2), y(3, 2);
    x << 1, 2, 1, 4, 1, 3;
    y << 1, 1, 2, 4, 3, 1;
    // Differences 0 1 | -1 0 | -2 2; the mean of y is 2.
    const Measures m = measure(x, y);
    EXPECT_NEAR(m.reference_mean, 2.0, 1e-12);
    EXPECT_NEAR(m.rel_rmse, std::sqrt(10.0 / 6.0) / 2.0, 1e-12);
    EXPECT_NEAR(m.rel_l1, 1.0 / 2.0, 1e-12);
    EXPECT_NEAR(m.bias, 0.0, 1e-12);
    // Both samples: mean |difference| 1, mean y 2.
    EXPECT_NEAR(m.median, 1.0 / 2.02, 1e-12);
    EXPECT_NEAR(m.p99, 1.0 / 2.02, 1e-12);
}

TEST(Measures, AConstantFactorIsAllBias) {
    const Eigen::Array3Xf y = Eigen::Array3Xf::Constant(3, 10, 0.5f);
    const Measures m = measure(1.1f * y, y);
    EXPECT_NEAR(m.bias, 0.1, 1e-6);
    EXPECT_NEAR(m.rel_l1, 0.1, 1e-6);
    EXPECT_NEAR(m.rel_rmse, 0.1, 1e-6);
    EXPECT_NEAR(m.median, 0.1 / 1.01, 1e-6);
}

TEST(Measures, PercentilesLeaveTheirShareAbove) {
    Eigen::Array3Xf y = Eigen::Array3Xf::Ones(3, 100), x = y;
    for (int k = 0; k < 100; ++k)
        x.col((37 * k) % 100) += static_cast<float>(k) * 1.01f;
    const Measures m = measure(x, y);
    EXPECT_NEAR(m.median, 49.0, 1e-4); // the 50th of 0, 1, ... 99
    EXPECT_NEAR(m.p95, 94.0, 1e-4);
    EXPECT_NEAR(m.p99, 98.0, 1e-4);
}

TEST(Measures, RefuseWhatCannotBeCompared) {
    const Eigen::Array3Xf one = Eigen::Array3Xf::Ones(3, 4);
    EXPECT_THROW(measure(one, Eigen::Array3Xf::Ones(3, 5)), Error);
    EXPECT_THROW(measure(Eigen::Array3Xf(3, 0), Eigen::Array3Xf(3, 0)), Error);
    EXPECT_THROW(measure(one, Eigen::Array3Xf::Zero(3, 4)), Error);
    Eigen::Array3Xf broken = one;
    broken(1, 2) = std::numeric_limits<float>::quiet_NaN();
    EXPECT_THROW(measure(broken, one), Error);
    EXPECT_THROW(measure(one, broken), Error);
}

} // namespace
} // namespace afterglow
