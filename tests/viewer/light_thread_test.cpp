#include "viewer/light_thread.h"

#include "core/error.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

namespace afterglow {
namespace {

Spotlight pose(float x) { return {.position = {x, 0.0f, 0.0f}}; }

LitField wait_for(LightThread& thread) {
    for (int k = 0; k < 5000; ++k) {
        if (std::optional<LitField> lit = thread.take()) return *lit;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ADD_FAILURE() << "no result";
    return {};
}

TEST(LightThread, TheNewestPoseWins) {
    std::atomic<int> solved = 0;
    std::atomic<bool> go = false;
    LightThread thread([&](const Spotlight& light) {
        while (!go) std::this_thread::yield();
        ++solved;
        LitField lit{light, nullptr, {}};
        lit.statistics.settled = true;
        return lit;
    });
    for (int k = 0; k < 100; ++k) thread.set(pose(static_cast<float>(k)));
    EXPECT_TRUE(thread.is_busy());
    go = true;
    while (wait_for(thread).light.position.x() != 99.0f) {}
    // The one at work when they came, perhaps, and the last.
    EXPECT_LE(solved, 2);
    EXPECT_FALSE(thread.take());
    EXPECT_FALSE(thread.is_busy());
}

TEST(LightThread, SolvesAPoseUntilItHasSettled) {
    int rounds = 0;
    LightThread thread([&](const Spotlight& light) {
        LitField lit{light, nullptr, {}};
        lit.statistics.settled = ++rounds == 5;
        return lit;
    });
    thread.set(pose(1.0f));
    while (!wait_for(thread).statistics.settled) {}
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_FALSE(thread.is_busy());
    EXPECT_EQ(rounds, 5);
}

TEST(LightThread, TellsOfAFailureAndGoesOn) {
    LightThread thread([](const Spotlight& light) -> LitField {
        if (light.position.x() < 0.0f) throw std::runtime_error("no light");
        LitField lit{light, nullptr, {}};
        lit.statistics.settled = true;
        return lit;
    });
    thread.set(pose(-1.0f));
    EXPECT_THROW(wait_for(thread), Error);
    thread.set(pose(2.0f));
    EXPECT_EQ(wait_for(thread).light.position.x(), 2.0f);
}

TEST(LightThread, EndsWhileItIsAtWork) {
    LightThread thread([](const Spotlight& light) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        return LitField{light, nullptr, {}}; // never settles
    });
    thread.set(pose(1.0f));
}

} // namespace
} // namespace afterglow
