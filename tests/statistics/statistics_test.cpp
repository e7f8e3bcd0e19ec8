#include "tests/support/statistics.h"

#include "core/sampling.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

// The yardsticks themselves, against printed tables and closed forms.

namespace afterglow {
namespace {

TEST(SidakLevel, GivesTheFamilyItsLevel) {
    EXPECT_DOUBLE_EQ(sidak_level(0.01, 1), 0.01);
    EXPECT_NEAR(1.0 - std::pow(1.0 - sidak_level(0.01, 2304), 2304), 0.01, 1e-12);
}

TEST(ChiSquareTest, FollowsPearsonAndTheTables) {
    // (44 - 50)^2 / 50 + (56 - 50)^2 / 50 = 1.44; of one degree of freedom p = erfc(1.2 / sqrt(2)).
    const std::array<std::uint64_t, 2> counts = {44, 56};
    const std::array<double, 2> halves = {0.5, 0.5};
    const ChiSquare two = chi_square_test(counts, halves);
    EXPECT_NEAR(two.statistic, 1.44, 1e-12);
    EXPECT_NEAR(two.p_value, std::erfc(1.2 / std::sqrt(2.0)), 1e-12);
    // The upper five percent of ten degrees of freedom begin at 18.307.
    EXPECT_NEAR(spread_p_value(18.307, 10), 0.10, 1e-4);
}

TEST(ChiSquareTest, PoolsCellsThatExpectFewerThanFive) {
    const std::array<std::uint64_t, 5> counts = {1, 2, 1, 48, 48};
    const std::array<double, 5> probability = {0.02, 0.02, 0.02, 0.47, 0.47};
    const ChiSquare pooled = chi_square_test(counts, probability);
    EXPECT_EQ(pooled.degrees, 2.0);
    EXPECT_NEAR(pooled.statistic, 4.0 / 6.0 + 2.0 / 47.0, 1e-12);
}

TEST(ChiSquareTest, RejectsADrawWhereNoneCanBe) {
    const std::array<std::uint64_t, 3> counts = {50, 1, 50};
    const std::array<double, 3> probability = {0.5, 0.0, 0.5};
    EXPECT_EQ(chi_square_test(counts, probability).p_value, 0.0);
}

TEST(DrawsToSee, GivesThePowerOfACoin) {
    // One degree of freedom is a squared normal variable: a coin of 0.51 is seen with power 0.975 at
    // 5 % by (1.96 + 1.96)^2 / 0.02^2 throws.
    const double effect = 2.0 * 0.01 * 0.01 / 0.5;
    EXPECT_NEAR(static_cast<double>(draws_to_see(effect, 2, 0.05, 0.975)),
                std::pow(2.0 * 1.959964, 2.0) / effect, 3.0);
}

TEST(WelchTest, FollowsItsFormula) {
    // Means 2 and 5, variances of the means 1/3 and 4/3: t = -3 / sqrt(5/3), and the degrees
    // (5/3)^2 / ((1/9) / 2 + (16/9) / 2) = 50 / 17.
    const std::array<double, 3> a = {1.0, 2.0, 3.0}, b = {3.0, 5.0, 7.0};
    const Welch test = welch_test(a, b);
    EXPECT_NEAR(test.t, -3.0 / std::sqrt(5.0 / 3.0), 1e-12);
    EXPECT_NEAR(test.degrees, 50.0 / 17.0, 1e-12);
    const double z = z_score({2.0, 1.0 / 3.0, 2.0}, {5.0, 4.0 / 3.0, 2.0});
    EXPECT_LT(z, 0.0);
    EXPECT_NEAR(normal_p_value(z), test.p_value, 1e-12);
}

TEST(ZScore, HasTheTailsOfStudentsT) {
    // Of one degree of freedom, t = 12.706 is the table's two-sided five percent, as z = 1.960 is.
    EXPECT_NEAR(z_score({12.706, 1.0, 1.0}, {0.0, 0.0, 1.0}), 1.960, 1e-3);
    EXPECT_EQ(z_score({1.0, 0.0, 9.0}, {1.0, 0.0, 9.0}), 0.0);
    EXPECT_EQ(normal_p_value(z_score({1.0, 0.0, 9.0}, {2.0, 0.0, 9.0})), 0.0);
}

} // namespace
} // namespace afterglow
