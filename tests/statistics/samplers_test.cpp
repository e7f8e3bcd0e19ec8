#include "tests/statistics/draws.h"
#include "tests/statistics/knobs.h"
#include "tests/support/statistics.h"

#include <gtest/gtest.h>

#include <numeric>

// Pearson's chi-square test for every sampler, all of them one family at one percent. Points of a
// low-discrepancy sequence are spread more evenly than independent draws, so that their counts have
// no chi-square distribution; each such draw is therefore one point of a scramble (or shift, or
// shuffle) of its own, and those are independent.
//
// How many draws: a sampler that puts 2 % of one half of its draws into the other has
// sum (p' - p)^2 / p = 0.02^2, and as many are drawn as let the test see that with a probability of
// 0.9999. A mistake of any one test in a run with other seeds is then one in a few hundred.

namespace afterglow {
namespace {

class Sampling : public testing::TestWithParam<SamplerCase> {
protected:
    double level = sidak_level(family_level, sampler_cases().size());

    double p_value(double error) const {
        const SamplerCase& sampler = GetParam();
        const std::uint64_t draws = draws_to_see(sampler.effect * error_to_see * error_to_see,
                                                 sampler.cells, level, 0.9999);
        const Draws result = sampler.draw(draws, error);
        const double total = std::accumulate(result.probability.begin(), result.probability.end(), 0.0);
        EXPECT_NEAR(total, 1.0, 1e-4); // far below what so many draws can see
        const ChiSquare test = chi_square_test(result.counts, result.probability);
        RecordProperty("p_value", std::to_string(test.p_value));
        RecordProperty("samples", std::to_string(draws));
        return test.p_value;
    }
};

TEST_P(Sampling, FollowsItsDensity) {
    EXPECT_GT(p_value(0.0), level);
}

TEST_P(Sampling, IsRejectedWithAnError) {
    EXPECT_LT(p_value(put_in()), level);
}

INSTANTIATE_TEST_SUITE_P(Every, Sampling, testing::ValuesIn(sampler_cases()),
                         [](const auto& sampler) { return sampler.param.name; });

} // namespace
} // namespace afterglow
