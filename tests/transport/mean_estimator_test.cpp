#include "core/sampling.h"
#include "transport/mean_estimator.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

namespace afterglow {
namespace {

/// Item i: exponentially distributed with mean i + 1, so that the standard deviation is i + 1 too;
/// output 1 is constant.
std::uint64_t exponential(Index item, std::uint64_t seed, Index first, Index count,
                          std::span<Eigen::Array3d> sums) {
    for (Index k = first; k < first + count; ++k) {
        const double u = Rng(seed, static_cast<std::uint64_t>(k)).uniform();
        sums[0] += -std::log(1.0 - u) * static_cast<double>(item + 1);
        sums[1] += 2.0;
    }
    return static_cast<std::uint64_t>(count);
}

TEST(MeanEstimator, MeansAndErrorsAreThoseOfTheDistribution) {
    const MeanEstimate e = estimate_means(64, 2, exponential, {.samples = 4096, .seed = 3});
    double squares = 0.0;
    for (Index i = 0; i < 64; ++i) {
        const double mean = static_cast<double>(i + 1), error = mean / 64.0; // sqrt(4096)
        EXPECT_NEAR(e.mean(0, 2 * i), mean, 4.5 * error);
        squares += std::pow(e.standard_error(0, 2 * i) / error, 2.0) / 64.0;
        EXPECT_FLOAT_EQ(e.mean(0, 2 * i + 1), 2.0f);
        EXPECT_NEAR(e.standard_error(0, 2 * i + 1), 0.0f, 1e-6f);
    }
    // A variance from 16 batches has a relative deviation of sqrt(2 / 15).
    EXPECT_NEAR(squares, 1.0, 4.0 * std::sqrt(2.0 / 15.0 / 64.0));
    EXPECT_NEAR(e.relative_error[0], 0.018, 0.002); // sqrt(mean (i + 1)^2) / 64 / mean (i + 1)
    EXPECT_NEAR(e.relative_error[1], 0.0, 1e-6);
    EXPECT_EQ(e.samples, 64u * 4096u);
    EXPECT_EQ(e.rays, 64u * 4096u);
}

TEST(MeanEstimator, LooksLongerForWhatIsRareAndEndsWhereThereIsNothing) {
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
        constexpr double share = 1e-3; // of samples that find anything: of the first 192, hardly ever one
        const Sampler rare = [](Index, std::uint64_t stream, Index first, Index count, std::span<Eigen::Array3d> sums) {
            for (Index k = first; k < first + count; ++k)
                if (Rng(stream, static_cast<std::uint64_t>(k)).uniform() < share) sums[0] += 1.0;
            return std::uint64_t{0};
        };
        const MeanEstimate e = estimate_means(1, 1, rare, {.target_error = 0.05, .seed = seed});
        EXPECT_NEAR(e.mean(0, 0), share, 5.0 * 0.05 * share);
        EXPECT_GT(e.relative_error[0], 0.0);
        EXPECT_LE(e.relative_error[0], 0.05);
    }
    const Sampler nothing = [](Index, std::uint64_t, Index, Index, std::span<Eigen::Array3d>) { return std::uint64_t{0}; };
    const MeanEstimate dark = estimate_means(3, 2, nothing, {.target_error = 0.05});
    EXPECT_TRUE((dark.mean == 0.0f).all());
    EXPECT_GE(dark.samples, 1u << 20);
    EXPECT_LE(dark.samples, 1u << 23);
}

TEST(MeanEstimator, ReachesATargetAndGivesNoisyItemsMoreSamples) {
    std::vector<std::atomic<Index>> taken(64);
    const Sampler counting = [&](Index item, std::uint64_t seed, Index first, Index count,
                                 std::span<Eigen::Array3d> sums) {
        taken[static_cast<std::size_t>(item)] += count;
        return exponential(item, seed, first, count, sums);
    };
    const MeanEstimate e = estimate_means(64, 2, counting, {.target_error = 0.01, .seed = 4});
    EXPECT_LE(e.relative_error[0], 0.01);
    EXPECT_GT(e.relative_error[0], 0.004) << "far more samples than were needed";
    EXPECT_GT(taken[63], 2 * taken[0]);
    double difference = 0.0, variance = 0.0;
    for (Index i = 0; i < 64; ++i) {
        difference += e.mean(0, 2 * i) - static_cast<double>(i + 1);
        variance += std::pow(e.standard_error(0, 2 * i), 2.0);
    }
    EXPECT_LT(std::abs(difference), 4.0 * std::sqrt(variance));
}

TEST(MeanEstimator, GivesUpAtTheLargestNumberOfSamples) {
    const MeanEstimate e =
        estimate_means(8, 2, exponential, {.target_error = 1e-6, .max_samples = 4096, .seed = 4});
    EXPECT_GT(e.relative_error[0], 1e-6);
    EXPECT_LE(e.samples, 8u * (4096u + 16u * 8u + 128u));
}

TEST(MeanEstimator, KeepsToASmallBudget) {
    // Rounded up in each of 16 batches, and the pilot's 128; where much more is wanted, and where less.
    for (const double target : {1e-6, 0.5})
        for (const Index budget : {16, 37, 64, 200}) {
            const MeanEstimate e =
                estimate_means(8, 2, exponential, {.target_error = target, .max_samples = budget, .seed = 4});
            EXPECT_LE(e.samples, 8 * (budget + 16 + 128)) << budget << ", " << target;
        }
}

TEST(MeanEstimator, BlackItemsHaveNoErrorAndReachAnyTarget) {
    const Sampler black = [](Index, std::uint64_t, Index, Index, std::span<Eigen::Array3d>) {
        return std::uint64_t{0};
    };
    const MeanEstimate e = estimate_means(8, 1, black, {.target_error = 0.01});
    EXPECT_TRUE((e.mean == 0.0f).all());
    EXPECT_EQ(e.relative_error[0], 0.0);
}

} // namespace
} // namespace afterglow
