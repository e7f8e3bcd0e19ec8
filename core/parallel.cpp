#include "core/parallel.h"

#include <immintrin.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace afterglow {

ThreadLimit::ThreadLimit(int threads)
    : control_(new tbb::global_control(
          tbb::global_control::max_allowed_parallelism,
          static_cast<std::size_t>(threads > 0 ? threads : tbb::this_task_arena::max_concurrency()))) {}

ThreadLimit::~ThreadLimit() { delete static_cast<tbb::global_control*>(control_); }

int thread_count() {
    return static_cast<int>(
        std::min(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                 static_cast<std::size_t>(tbb::this_task_arena::max_concurrency())));
}

void parallel_ranges(Index count, Index grain, const std::function<void(Index, Index)>& body) {
    const Index chunks = (count + grain - 1) / grain;
    tbb::parallel_for(
        tbb::blocked_range<Index>(0, chunks, 1),
        [&](const tbb::blocked_range<Index>& range) {
            _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
            _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
            for (Index c = range.begin(); c < range.end(); ++c)
                body(c * grain, std::min(count, (c + 1) * grain));
        },
        tbb::simple_partitioner());
}

void parallel_sort(std::span<std::uint64_t> keys) { tbb::parallel_sort(keys.begin(), keys.end()); }

} // namespace afterglow
