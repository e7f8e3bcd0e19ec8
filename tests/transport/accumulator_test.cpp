#include "core/sampling.h"
#include "transport/accumulator.h"

#include <gtest/gtest.h>

#include <cstdint>
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
        struct Range {
            std::uint32_t begin, end;
        };
        for (const Range range : {Range{0, 1000}, {63, 65}, {64, 128}, {100, 771}}) {
            std::uint32_t last = 0;
            bool first = true;
            double seen = 0.0, expected = 0.0;
            sum.for_each(range.begin, range.end, [&](std::uint32_t i, float value) {
                EXPECT_TRUE(first || i > last);
                first = false;
                EXPECT_TRUE(i >= range.begin && i < range.end);
                EXPECT_EQ(value, dense[i]);
                last = i;
                seen += value;
            });
            for (std::uint32_t i = range.begin; i < range.end; ++i)
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
