#include "viewer/light_thread.h"

#include "core/error.h"

#include <utility>

namespace afterglow {

LightThread::LightThread(Solve solve) : solve_(std::move(solve)), thread_([this] { run(); }) {}

LightThread::~LightThread() {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
    }
    changed_.notify_one();
    thread_.join();
}

void LightThread::set(const Spotlight& light) {
    {
        const std::lock_guard lock(mutex_);
        wanted_ = light;
    }
    changed_.notify_one();
}

std::optional<LitField> LightThread::take() {
    const std::lock_guard lock(mutex_);
    if (failure_) throw Error(*std::exchange(failure_, std::nullopt));
    return std::exchange(result_, std::nullopt);
}

bool LightThread::is_busy() const {
    const std::lock_guard lock(mutex_);
    return at_work_ || wanted_ || result_;
}

void LightThread::run() {
    std::unique_lock lock(mutex_);
    while (true) {
        changed_.wait(lock, [this] { return stop_ || wanted_; });
        if (stop_) return;
        const Spotlight light = *std::exchange(wanted_, std::nullopt);
        at_work_ = true;
        lock.unlock();
        std::optional<LitField> lit;
        std::optional<std::string> failure;
        try {
            lit = solve_(light);
        } catch (const std::exception& error) {
            failure = error.what();
        }
        lock.lock();
        at_work_ = false;
        if (lit) {
            if (!lit->statistics.settled && !wanted_) wanted_ = light;
            result_ = std::move(lit);
        } else {
            failure_ = std::move(failure);
        }
    }
}

} // namespace afterglow
