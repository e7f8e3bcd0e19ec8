#pragma once

#include <functional>
#include <mutex>
#include <string>

namespace afterglow {

inline constexpr const char* out_of_memory =
    "there is not enough memory; end other programs, or lift the limit that it was started with (ulimit -v)";

/// How a process ends in the middle of its work: by SIGINT, SIGTERM or SIGHUP, where an exception has
/// nowhere to go, or where a file that it reads in place is cut short by others (SIGBUS). It ends at once, whatever its threads are at, with one line on stderr.

/// While it lives, an early end calls `undo` and ends its line with `note`, that of the oldest object
/// that has one. Undo must not allocate memory: there may be none.
class AtEarlyEnd {
public:
    explicit AtEarlyEnd(std::function<void()> undo, std::string note = "");
    ~AtEarlyEnd();
    AtEarlyEnd(const AtEarlyEnd&) = delete;
    AtEarlyEnd& operator=(const AtEarlyEnd&) = delete;

private:
    friend struct EarlyEnd;
    std::function<void()> undo_;
    std::string note_;
    AtEarlyEnd *older_ = nullptr, *newer_ = nullptr;
};

/// While this is held no early end begins; once one has begun it is never got. So what is done under it
/// is done whole and seen by `undo`, or not done at all. Only for a few system calls, and not to be held
/// where an AtEarlyEnd is made or goes.
std::unique_lock<std::mutex> hold_off_early_end();

/// For main(), before all else. Signals that end the process do so with status 128 + their number
/// (those that it was started to ignore stay ignored), want of memory that nobody catches and SIGBUS with status 1.
/// A file that grows beyond a limit is a write error, not a signal. Standard streams that are closed are
/// held by /dev/null, so that no file is opened in their place and written to as if it were one; writing to
/// them still fails.
void prepare_process(const std::string& program);

} // namespace afterglow
