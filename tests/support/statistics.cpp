#include "tests/support/statistics.h"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/non_central_chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

namespace afterglow {
namespace {

namespace distributions = boost::math;

/// Welch and Satterthwaite's degrees of freedom of the difference.
double joint_degrees(const KnownMean& a, const KnownMean& b) {
    const double variance = a.variance + b.variance;
    return variance * variance
           / (a.variance * a.variance / a.degrees + b.variance * b.variance / b.degrees);
}

double above(double t, double degrees) {
    return cdf(complement(distributions::students_t(degrees), t));
}

KnownMean mean_of(std::span<const double> values) {
    const auto n = static_cast<double>(values.size());
    assert(values.size() >= 2);
    KnownMean result;
    result.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
    for (const double value : values) result.variance += std::pow(value - result.mean, 2.0);
    result.variance /= n * (n - 1.0);
    result.degrees = n - 1.0;
    return result;
}

} // namespace

double sidak_level(double family, std::size_t tests) {
    return -std::expm1(std::log1p(-family) / static_cast<double>(tests));
}

ChiSquare chi_square_test(std::span<const std::uint64_t> observed,
                          std::span<const double> probability) {
    constexpr double least_expected = 5.0;
    assert(observed.size() == probability.size());
    const auto draws = static_cast<double>(
        std::accumulate(observed.begin(), observed.end(), std::uint64_t{0}));
    std::vector<std::size_t> order(observed.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return probability[a] < probability[b];
    });

    struct Pool {
        double observed = 0.0, expected = 0.0;
    };
    std::vector<Pool> pools(1);
    for (const std::size_t cell : order) {
        if (probability[cell] <= 0.0) {
            if (observed[cell] > 0) return {std::numeric_limits<double>::infinity(), 1.0, 0.0};
            continue;
        }
        if (pools.back().expected >= least_expected) pools.emplace_back();
        pools.back().observed += static_cast<double>(observed[cell]);
        pools.back().expected += draws * probability[cell];
    }
    if (pools.size() > 2 && pools.back().expected < least_expected) {
        pools[pools.size() - 2].observed += pools.back().observed;
        pools[pools.size() - 2].expected += pools.back().expected;
        pools.pop_back();
    }
    ChiSquare result;
    for (const Pool& pool : pools)
        result.statistic += std::pow(pool.observed - pool.expected, 2.0) / pool.expected;
    result.degrees = static_cast<double>(pools.size()) - 1.0;
    assert(result.degrees >= 1.0);
    result.p_value = cdf(complement(distributions::chi_squared(result.degrees), result.statistic));
    return result;
}

double spread_p_value(double sum_of_squares, std::size_t count) {
    if (!std::isfinite(sum_of_squares)) return 0.0;
    const distributions::chi_squared distribution(static_cast<double>(count));
    return 2.0 * std::min(cdf(distribution, sum_of_squares),
                          cdf(complement(distribution, sum_of_squares)));
}

std::uint64_t draws_to_see(double squared_effect, std::size_t cells, double level, double power) {
    const double degrees = static_cast<double>(cells) - 1.0;
    const double critical = quantile(complement(distributions::chi_squared(degrees), level));
    const double parameter = distributions::non_central_chi_squared::find_non_centrality(
        degrees, critical, 1.0 - power);
    return static_cast<std::uint64_t>(std::ceil(parameter / squared_effect));
}

Welch welch_test(std::span<const double> a, std::span<const double> b) {
    const KnownMean of_a = mean_of(a), of_b = mean_of(b);
    Welch result;
    result.t = (of_a.mean - of_b.mean) / std::sqrt(of_a.variance + of_b.variance);
    result.degrees = joint_degrees(of_a, of_b);
    result.p_value = 2.0 * above(std::abs(result.t), result.degrees);
    return result;
}

double z_score(const KnownMean& a, const KnownMean& b) {
    const double difference = a.mean - b.mean, variance = a.variance + b.variance;
    if (difference == 0.0) return 0.0;
    if (!(variance > 0.0)) return std::copysign(std::numeric_limits<double>::infinity(), difference);
    const double tail = above(std::abs(difference) / std::sqrt(variance), joint_degrees(a, b));
    if (!(tail > 0.0)) return std::copysign(std::numeric_limits<double>::infinity(), difference);
    return std::copysign(quantile(complement(distributions::normal(), tail)), difference);
}

double normal_p_value(double z) {
    if (std::isinf(z)) return 0.0;
    return 2.0 * cdf(complement(distributions::normal(), std::abs(z)));
}

} // namespace afterglow
