#pragma once

#include <cstddef>

namespace afterglow {

/// Starts to note the sizes asked of operator new, in all threads.
void watch_allocations();

/// The largest single allocation since [bytes].
std::size_t largest_allocation();

} // namespace afterglow
