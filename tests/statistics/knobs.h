#pragma once

#include <cstdint>

// What tests/statistics/repeat.py turns to measure how often the tests reject.

namespace afterglow {

/// A seed of its own for each test and use, from AFTERGLOW_STATISTICS_SEED (0 unless set). To be
/// called while a test runs.
std::uint64_t test_seed(std::uint64_t use);

/// The error that companion tests put in, AFTERGLOW_STATISTICS_ERROR (2 % unless set).
double put_in();

/// The error that every test has to see, for which samples are counted.
inline constexpr double error_to_see = 0.02;

} // namespace afterglow
