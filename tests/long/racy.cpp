#include "core/parallel.h"

#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

// What ThreadSanitizer must see (`sum`, `list`: bodies of a parallel loop that share a variable; `thread`: another
// thread's), and what it must not (`right`: each body has a slot, read after the loop).

using namespace afterglow;

int main(int argc, char** argv) {
    const std::string kind = argc > 1 ? argv[1] : "";
    constexpr Index count = 100000;
    const ThreadLimit limit(2);
    std::vector<double> slot(count, 1.0);
    double sum = 0.0;
    if (kind == "sum")
        parallel_for(count, [&](Index i) { sum += slot[static_cast<std::size_t>(i)]; });
    if (kind == "list") {
        std::vector<Index> list;
        parallel_for(count, [&](Index i) { if (i % 1000 == 0) list.push_back(i); });
        sum = static_cast<double>(list.size());
    }
    if (kind == "thread") {
        std::thread other([&] { sum += 1.0; });
        sum += 2.0;
        other.join();
    }
    if (kind == "right") {
        parallel_for(count, [&](Index i) { slot[static_cast<std::size_t>(i)] += static_cast<double>(i); });
        sum = parallel_sum(count, 0.0, [&](Index i) { return slot[static_cast<std::size_t>(i)]; });
        parallel_for(count, [&](Index i) { slot[static_cast<std::size_t>(i)] = sum; });
    }
    std::printf("%g\n", sum + slot.back());
    return EXIT_SUCCESS;
}
