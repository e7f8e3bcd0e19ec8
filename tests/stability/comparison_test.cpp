#include "core/sampling.h"
#include "tests/stability/comparison.h"

#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

/// Indirect light that is `error` above a truth of 2, against a reference whose noise is uniform
/// with the standard deviation `noise`.
Comparison example(float error, float noise) {
    constexpr Index places = 20000;
    Comparison comparison;
    comparison.indirect = Eigen::Array3Xf::Constant(3, places, 2.0f + error);
    comparison.reference = Eigen::Array3Xf::Constant(3, places, 2.0f);
    comparison.standard_error = Eigen::Array3Xf::Constant(3, places, noise);
    for (Index p = 0; p < places; ++p) {
        Rng rng(7, static_cast<std::uint64_t>(p));
        for (int c = 0; c < 3; ++c)
            comparison.reference(c, p) += noise * std::sqrt(12.0f) * (rng.uniform() - 0.5f);
    }
    return comparison;
}

// Of 60000 squares of noise of .2, the mean is known to .04 / sqrt(60000) = 2e-4: an error of .1
// comes out to 1e-3, and one of zero as at most sqrt(3 * 2e-4) = .024, an eighth of the noise.

TEST(Comparison, TakesTheReferencesNoiseOutOfTheError) {
    EXPECT_NEAR(example(0.1f, 0.2f).rel_rmse(), 0.05, 2e-3);
    EXPECT_LT(example(0.0f, 0.2f).rel_rmse(), 0.012);
    EXPECT_NEAR(example(0.1f, 0.2f).reference_error(), 0.1, 1e-3);
    EXPECT_NEAR(example(0.1f, 0.2f).bias(), 0.05, 2e-3);
}

TEST(Comparison, IsRelativeToTheMeanThatIsAskedFor) {
    EXPECT_NEAR(example(0.1f, 0.0f).rel_rmse(4.0), 0.025, 1e-5);
}

TEST(Comparison, OfAPartSeesThatPartAlone) {
    Comparison comparison = example(0.0f, 0.0f);
    comparison.indirect.middleCols(100, 50) += 0.2f;
    EXPECT_NEAR(comparison.part(100, 50).rel_rmse(), 0.1, 1e-5);
    EXPECT_EQ(comparison.part(0, 100).rel_rmse(), 0.0);
}

} // namespace
} // namespace afterglow
