#pragma once

#include "core/process_end.h"

#include <string>
#include <sys/types.h>

namespace afterglow {

/// `afterglow precompute` at work in a process of its own: it can be stopped at any time, ends with this one however
/// that ends, and its file appears whole or not at all.
class PrecomputeTask {
public:
    enum class State { at_work, done, failed };

    /// Starts it; the program lies beside this one, or where PATH says. `threads`: 0 for all processors. Throws Error
    /// where it cannot be started.
    PrecomputeTask(const std::string& scene, const std::string& file, int threads = 0);
    /// Stops it.
    ~PrecomputeTask();
    PrecomputeTask(const PrecomputeTask&) = delete;
    PrecomputeTask& operator=(const PrecomputeTask&) = delete;

    State state();
    const std::string& file() const { return file_; }
    double seconds() const; // since it was started
    /// The last line it wrote: how it goes, or why it failed.
    const std::string& message() const { return message_; }

private:
    std::string file_, message_;
    std::string written_; // since the last whole line
    double start_ = 0.0;
    pid_t process_ = -1;
    int output_ = -1;
    State state_ = State::at_work;
    AtEarlyEnd at_early_end_{[this] { stop(); }};

    void stop();
    void read_output();
};

} // namespace afterglow
