#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// How often a whole family of tests may reject though nothing is wrong.
inline constexpr double family_level = 0.01;

/// The level of each of n tests with which the family keeps `family`: 1 - (1 - family)^(1/n)
/// (Sidak 1967). Exact for independent tests; for two-sided tests of normal variables that depend
/// on each other it errs on the safe side.
double sidak_level(double family, std::size_t tests);

struct ChiSquare {
    double statistic = 0.0;
    double degrees = 0.0; // of freedom
    double p_value = 1.0; // of a statistic as large or larger
};

/// Pearson's test of independent draws, counted by cells, against the cells' probabilities, which
/// sum to 1. Cells are pooled, the least likely first, until each expects five draws or more. A draw
/// where none can be has the p-value 0.
ChiSquare chi_square_test(std::span<const std::uint64_t> observed,
                          std::span<const double> probability);

/// A sum of squares of `count` independent standard normal variables, two-sided: a spread that is too
/// small is as wrong as one that is too large.
double spread_p_value(double sum_of_squares, std::size_t count);

/// Draws with which a chi-square test of so many cells rejects with probability `power` at `level`
/// if sum (p' - p)^2 / p = squared_effect, p' what the draws really follow: the statistic then has
/// the non-central distribution with the parameter draws * squared_effect.
std::uint64_t draws_to_see(double squared_effect, std::size_t cells, double level, double power);

struct Welch {
    double t = 0.0;
    double degrees = 0.0; // of freedom, by Welch and Satterthwaite
    double p_value = 1.0; // two-sided
};

/// Whether two samples have the same mean; their variances may differ (Welch 1947). At least two
/// values each.
Welch welch_test(std::span<const double> a, std::span<const double> b);

/// A mean, the variance of that mean and how many degrees of freedom the variance rests on.
struct KnownMean {
    double mean = 0.0, variance = 0.0, degrees = 1.0;
};

/// Welch's t of two means as the value of a standard normal variable that is as unlikely, so that many
/// such differences can be judged together. 0 where the means are equal; infinite where they differ
/// without any variance.
double z_score(const KnownMean& a, const KnownMean& b);

/// Of a standard normal variable, two-sided.
double normal_p_value(double z);

} // namespace afterglow
