#include "core/parallel.h"
#include "core/sampling.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <stdexcept>

namespace afterglow {
namespace {

float sum_of_noise(int threads, Index count) {
    const ThreadLimit limit(threads);
    return parallel_sum(count, 0.0f, [](Index i) {
        return std::exp(10.0f * Rng(7, static_cast<std::uint64_t>(i)).uniform());
    });
}

TEST(ParallelSum, HasTheSameBitsOnAnyNumberOfThreads) {
    for (const Index count : {0, 1, 255, 256, 257, 100'003}) {
        const float one = sum_of_noise(1, count);
        EXPECT_EQ(one, sum_of_noise(2, count)) << count;
        EXPECT_EQ(one, sum_of_noise(0, count)) << count;
    }
}

TEST(ParallelFor, VisitsEveryIndexOnce) {
    for (const Index count : {0, 1, 63, 64, 65, 10'000}) {
        std::vector<int> visits(static_cast<std::size_t>(count), 0);
        parallel_for(count, [&](Index i) { ++visits[static_cast<std::size_t>(i)]; });
        for (const int v : visits)
            ASSERT_EQ(v, 1);
    }
}

TEST(ParallelRanges, StartAtMultiplesOfTheGrain) {
    std::vector<Index> length(11, 0);
    parallel_ranges(1003, 100, [&](Index begin, Index end) {
        ASSERT_EQ(begin % 100, 0);
        length[static_cast<std::size_t>(begin / 100)] = end - begin;
    });
    for (std::size_t i = 0; i < 10; ++i)
        EXPECT_EQ(length[i], 100);
    EXPECT_EQ(length[10], 3);
}

TEST(ParallelFor, ThrowsWhatItsBodyThrows) {
    const auto fail_at_500 = [](Index i) {
        if (i == 500) throw std::runtime_error("500");
    };
    EXPECT_THROW(parallel_for(1000, fail_at_500), std::runtime_error);
}

TEST(ParallelFor, FlushesDenormalsInItsBodies) {
    volatile float tiny = 1e-30f;
    std::vector<float> product(200, 1.0f);
    parallel_for(
        200, [&](Index i) { product[static_cast<std::size_t>(i)] = tiny * 1e-10f; }, 1);
    for (const float p : product)
        EXPECT_EQ(p, 0.0f);
    EXPECT_GT(tiny * 1e-10f, 0.0f); // of whoever calls them
}

TEST(ThreadLimit, HoldsWhileItLives) {
    const int before = thread_count();
    {
        const ThreadLimit limit(1);
        EXPECT_EQ(thread_count(), 1);
    }
    EXPECT_EQ(thread_count(), before);
}

TEST(ScratchPool, MakesNoMoreThanRunAtOnceAndLendsNoneTwice) {
    std::atomic<int> made = 0, in_use_twice = 0;
    ScratchPool<std::atomic<int>> pool([&] {
        ++made;
        return std::make_unique<std::atomic<int>>(0);
    });
    const ThreadLimit limit(2);
    parallel_for(
        1000,
        [&](Index) {
            const auto users = pool.borrow();
            in_use_twice += users->fetch_add(1) != 0;
            users->fetch_sub(1);
        },
        1);
    EXPECT_EQ(in_use_twice, 0);
    EXPECT_GE(made, 1);
    EXPECT_LE(made, 2);
}

} // namespace
} // namespace afterglow
