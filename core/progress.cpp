#include "core/progress.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <unistd.h>
#include <utility>

namespace afterglow {

Progress::Progress(std::string what, bool wanted)
    : what_(std::move(what)), shown_(wanted && isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
    if (shown_) std::fputs("\r\x1b[K", stderr);
}

void Progress::update(double share) {
    if (!shown_) return;
    const std::lock_guard lock(mutex_);
    const Clock::time_point now = Clock::now();
    if (!(share > share_) || now - drawn_ < std::chrono::milliseconds(200)) return;
    share_ = share;
    drawn_ = now;
    const double passed = std::chrono::duration<double>(now - start_).count();
    std::fprintf(stderr, "\r\x1b[K%s %.0f %%, %s left", what_.c_str(), 100.0 * share,
                 duration_text(passed * (1.0 - share) / share).c_str());
    std::fflush(stderr);
}

std::string duration_text(double seconds) {
    const auto whole = static_cast<long long>(std::llround(std::fmax(0.0, seconds)));
    std::array<char, 64> text{};
    if (whole < 60)
        std::snprintf(text.data(), text.size(), "%lld s", whole);
    else if (whole < 3600)
        std::snprintf(text.data(), text.size(), "%lld min %02lld s", whole / 60, whole % 60);
    else
        std::snprintf(text.data(), text.size(), "%lld h %02lld min", whole / 3600, whole / 60 % 60);
    return text.data();
}

} // namespace afterglow
