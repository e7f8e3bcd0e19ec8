#include "core/sampling.h"
#include "transport/accumulator.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace afterglow {
namespace {

TEST(Accumulator, VisitsWhatWasUsedInOrderAndForgetsIt) {
    Accumulator<float> sum(1000, 0.0f);
    Rng rng(1, 0);
    for (int round = 0; round < 5; ++round) {
        std::vector<float> dense(1000, 0.0f);
        for (int k = 0; k < 60; ++k) {
            const auto i = static_cast<std::uint32_t>(rng.next() % 1000);
            const float value = rng.uniform();
            sum.at(i) += value;
            dense[i] += value;
        }
        for (const auto& [begin, end] :
             {std::pair(0u, 1000u), {63u, 65u}, {64u, 128u}, {100u, 771u}}) {
            std::uint32_t last = 0;
            bool first = true;
            double seen = 0.0, expected = 0.0;
            sum.for_each(begin, end, [&](std::uint32_t i, float value) {
                EXPECT_TRUE(first || i > last);
                first = false;
                EXPECT_TRUE(i >= begin && i < end);
                EXPECT_EQ(value, dense[i]);
                last = i;
                seen += value;
            });
            for (std::uint32_t i = begin; i < end; ++i)
                expected += dense[i];
            EXPECT_NEAR(seen, expected, 1e-5);
        }
        sum.clear();
        sum.for_each(0, 1000, [](std::uint32_t, float) { ADD_FAILURE() << "not forgotten"; });
        for (std::uint32_t i = 0; i < 1000; ++i)
            ASSERT_EQ(sum.at(i), 0.0f);
        sum.clear();
    }
}

} // namespace
} // namespace afterglow
