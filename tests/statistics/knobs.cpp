#include "tests/statistics/knobs.h"

#include "core/sampling.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

namespace afterglow {

std::uint64_t test_seed(std::uint64_t use) {
    const char* given = std::getenv("AFTERGLOW_STATISTICS_SEED");
    std::uint64_t seed = hash64(given ? std::stoull(given) : 0, use);
    for (const char c : std::string(testing::UnitTest::GetInstance()->current_test_info()->name()))
        seed = hash64(seed, static_cast<std::uint64_t>(c));
    return seed;
}

double put_in() {
    const char* given = std::getenv("AFTERGLOW_STATISTICS_ERROR");
    return given ? std::stod(given) : error_to_see;
}

} // namespace afterglow
