#pragma once

#include <chrono>
#include <mutex>
#include <string>

namespace afterglow {

/// One line on stderr: what is done, how much of it, and the time that is left. Silent unless
/// `wanted` and stderr is a terminal. May be told from several threads.
class Progress {
public:
    Progress(std::string what, bool wanted);
    ~Progress(); // wipes the line
    Progress(const Progress&) = delete;
    Progress& operator=(const Progress&) = delete;

    /// The share that is done, in [0, 1]; smaller than before is ignored.
    void update(double share);

private:
    using Clock = std::chrono::steady_clock;
    std::string what_;
    bool shown_;
    std::mutex mutex_;
    double share_ = 0.0;
    Clock::time_point start_ = Clock::now(), drawn_ = start_;
};

/// "42 s", "3 min 05 s", "2 h 07 min".
std::string duration_text(double seconds);

} // namespace afterglow
