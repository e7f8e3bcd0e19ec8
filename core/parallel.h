#pragma once

#include "core/types.h"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

namespace afterglow {

/// Limits every parallel loop of the process to `threads` (0: all processors) for as long as the
/// object lives. Results never depend on the number.
class ThreadLimit {
public:
    explicit ThreadLimit(int threads);
    ~ThreadLimit();
    ThreadLimit(const ThreadLimit&) = delete;
    ThreadLimit& operator=(const ThreadLimit&) = delete;

private:
    void* control_;
};

/// Number of threads that parallel loops use now.
int thread_count();

/// Calls body(begin, end) for consecutive ranges that cover [0, count), each at most `grain` long
/// and starting at a multiple of it, so that the split never depends on the number of threads.
/// Denormals are flushed to zero inside, and there alone. An exception of any body is thrown again here.
void parallel_ranges(Index count, Index grain, const std::function<void(Index, Index)>& body);

/// Does work that has parallel loops of its own and that other threads wait for (a lock, a once_flag): a
/// thread that waits for such a loop to end takes up nothing from outside it, which might wait in turn.
void isolated(const std::function<void()>& work);

/// Calls body(i) for each i in [0, count); each call owns the slot i of whatever it writes.
template <class Body>
void parallel_for(Index count, const Body& body, Index grain = 64) {
    parallel_ranges(count, grain, [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i) body(i);
    });
}

/// Sum of term(i) over [0, count), added up in fixed chunks and in order: the same bits at any
/// number of threads.
template <class T, class Term>
T parallel_sum(Index count, T zero, const Term& term, Index grain = 256) {
    std::vector<T> partial(static_cast<std::size_t>((count + grain - 1) / grain), zero);
    parallel_ranges(count, grain, [&](Index begin, Index end) {
        T sum = zero;
        for (Index i = begin; i < end; ++i) sum += term(i);
        partial[static_cast<std::size_t>(begin / grain)] = sum;
    });
    T total = zero;
    for (const T& p : partial) total += p;
    return total;
}

/// Sorts in parallel. Equal keys look the same, so the result does not depend on the number of threads.
void parallel_sort(std::span<std::uint64_t> keys);

/// Scratch objects that are costly to make: each body of a parallel loop borrows one, and there are
/// as many as bodies that ran at the same time. They come back as they were left.
template <class T>
class ScratchPool {
public:
    explicit ScratchPool(std::function<std::unique_ptr<T>()> make) : make_(std::move(make)) {}

    /// Returned to the pool when it goes out of scope.
    auto borrow() {
        std::unique_ptr<T> object;
        {
            const std::lock_guard lock(mutex_);
            if (!free_.empty()) {
                object = std::move(free_.back());
                free_.pop_back();
            }
        }
        if (!object) object = make_();
        const auto give_back = [this](T* returned) {
            const std::lock_guard lock(mutex_);
            free_.emplace_back(returned);
        };
        return std::unique_ptr<T, decltype(give_back)>(object.release(), give_back);
    }

private:
    std::function<std::unique_ptr<T>()> make_;
    std::mutex mutex_;
    std::vector<std::unique_ptr<T>> free_;
};

} // namespace afterglow
