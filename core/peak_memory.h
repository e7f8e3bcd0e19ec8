#pragma once

#include <sys/resource.h>

namespace afterglow {

/// The largest resident memory of this process so far [byte].
inline double peak_memory() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

} // namespace afterglow
