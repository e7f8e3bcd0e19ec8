#include "core/parallel.h"

#include <immintrin.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>

#include <algorithm>

#ifdef AFTERGLOW_THREAD_SANITIZER
#include <sanitizer/tsan_interface.h>
#endif

namespace afterglow {
namespace {

/// What a parallel loop orders, for ThreadSanitizer: all before the loop comes before its bodies, and they
/// before all after it; between two bodies there is no order. This file is compiled without it, as oneTBB
/// is, whose tasks go from thread to thread by ways that it cannot see.
class ForkJoin {
public:
    ForkJoin() { release(fork_); }
    ~ForkJoin() { acquire(join_); }
    ForkJoin(const ForkJoin&) = delete;
    ForkJoin& operator=(const ForkJoin&) = delete;

    class Body {
    public:
        explicit Body(ForkJoin& loop) : loop_(loop) { acquire(loop_.fork_); }
        ~Body() { release(loop_.join_); }
        Body(const Body&) = delete;
        Body& operator=(const Body&) = delete;

    private:
        ForkJoin& loop_;
    };

private:
    char fork_ = 0, join_ = 0; // their addresses count
#ifdef AFTERGLOW_THREAD_SANITIZER
    static void acquire(char& order) { __tsan_acquire(&order); }
    static void release(char& order) { __tsan_release(&order); }
#else
    static void acquire(char&) {}
    static void release(char&) {}
#endif
};

/// Flushes denormals to zero, in this thread, while it lives.
class DenormalsOff {
public:
    DenormalsOff() {
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    }
    ~DenormalsOff() { _mm_setcsr(before_); }
    DenormalsOff(const DenormalsOff&) = delete;
    DenormalsOff& operator=(const DenormalsOff&) = delete;

private:
    const unsigned before_ = _mm_getcsr();
};

} // namespace

ThreadLimit::ThreadLimit(int threads)
    : control_(new tbb::global_control(
          tbb::global_control::max_allowed_parallelism,
          static_cast<std::size_t>(threads > 0 ? threads : tbb::this_task_arena::max_concurrency()))) {}

void isolated(const std::function<void()>& work) {
    tbb::this_task_arena::isolate(work);
}

ThreadLimit::~ThreadLimit() { delete static_cast<tbb::global_control*>(control_); }

int thread_count() {
    return static_cast<int>(
        std::min(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                 static_cast<std::size_t>(tbb::this_task_arena::max_concurrency())));
}

void parallel_ranges(Index count, Index grain, const std::function<void(Index, Index)>& body) {
    const Index chunks = (count + grain - 1) / grain;
    ForkJoin loop;
    tbb::parallel_for(
        tbb::blocked_range<Index>(0, chunks, 1),
        [&](const tbb::blocked_range<Index>& range) {
            const ForkJoin::Body ordered(loop);
            const DenormalsOff flushed;
            for (Index c = range.begin(); c < range.end(); ++c)
                body(c * grain, std::min(count, (c + 1) * grain));
        },
        tbb::simple_partitioner());
}

void parallel_sort(std::span<std::uint64_t> keys) {
#ifdef AFTERGLOW_THREAD_SANITIZER
    // oneTBB's threads move keys by the C library's memmove, which ThreadSanitizer sees, without their order.
    std::sort(keys.begin(), keys.end());
#else
    tbb::parallel_sort(keys.begin(), keys.end());
#endif
}

} // namespace afterglow
