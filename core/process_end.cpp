#include "core/process_end.h"

#include "core/error.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <fcntl.h>
#include <new>
#include <string_view>
#include <system_error>
#include <thread>
#include <unistd.h>
#include <utility>

namespace afterglow {

/// The objects that live, and the end itself. Nothing here allocates memory.
struct EarlyEnd {
    static inline std::mutex mutex;
    static inline AtEarlyEnd* newest = nullptr;
    static inline std::string program;

    [[noreturn]] static void now(int status, std::string_view why) noexcept {
        mutex.lock(); // for good
        std::string_view note;
        for (const AtEarlyEnd* a = newest; a; a = a->older_) {
            if (a->undo_) a->undo_();
            if (!a->note_.empty()) note = a->note_;
        }
        // Past the stream's own lock: a thread may hold it.
        const auto say = [](std::string_view text) {
            while (!text.empty()) {
                const ssize_t count = ::write(STDERR_FILENO, text.data(), text.size());
                if (count <= 0) return;
                text.remove_prefix(static_cast<std::size_t>(count));
            }
        };
        if (isatty(STDERR_FILENO)) say("\r\x1b[K"); // over a line of progress
        say(program);
        say(": ");
        say(why);
        if (!note.empty()) say("; ");
        say(note);
        say("\n");
        ::_exit(status);
    }
};

namespace {

std::array<int, 2> signals; // a pipe from the handler to the thread that ends the process

void handle(int signal) {
    const int before = errno;
    const auto number = static_cast<unsigned char>(signal);
    // The pipe holds the first signal; a second says nothing new.
    [[maybe_unused]] const ssize_t written = ::write(signals[1], &number, 1);
    errno = before;
}

/// Bytes of a file that is mapped into memory are not there any more: this thread can do nothing else.
void handle_lost_bytes(int signal) {
    handle(signal);
    for (;;) ::pause();
}

void await_signal() {
    unsigned char number = 0;
    while (::read(signals[0], &number, 1) != 1) {
    }
    if (number == SIGBUS) EarlyEnd::now(1, "a file was cut short, or could not be read, while it was in use");
    EarlyEnd::now(128 + number, number == SIGINT    ? "interrupted"
                                : number == SIGTERM ? "ended by SIGTERM"
                                                    : "ended by SIGHUP");
}

/// Where an exception leaves a thread or a function of a library that may not throw: want of memory,
/// as a rule.
[[noreturn]] void end_by_exception() {
    try {
        if (std::current_exception()) std::rethrow_exception(std::current_exception());
    } catch (const std::bad_alloc&) {
        EarlyEnd::now(1, out_of_memory);
    } catch (const std::exception& error) {
        EarlyEnd::now(1, error.what());
    } catch (...) {
    }
    EarlyEnd::now(1, "ended by a fault of its own");
}

} // namespace

AtEarlyEnd::AtEarlyEnd(std::function<void()> undo, std::string note)
    : undo_(std::move(undo)), note_(std::move(note)) {
    const std::lock_guard lock(EarlyEnd::mutex);
    older_ = std::exchange(EarlyEnd::newest, this);
    if (older_) older_->newer_ = this;
}

AtEarlyEnd::~AtEarlyEnd() {
    const std::lock_guard lock(EarlyEnd::mutex);
    (newer_ ? newer_->older_ : EarlyEnd::newest) = older_;
    if (older_) older_->newer_ = newer_;
}

std::unique_lock<std::mutex> hold_off_early_end() { return std::unique_lock(EarlyEnd::mutex); }

void prepare_process(const std::string& program) {
    for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
        if (fcntl(stream, F_GETFD) == -1) // takes the lowest number, which is this one
            [[maybe_unused]] const int held = open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
    std::signal(SIGXFSZ, SIG_IGN);
    EarlyEnd::program = program;
    std::set_terminate(end_by_exception);

    if (pipe2(signals.data(), O_CLOEXEC) != 0)
        throw Error(std::string("no pipe for signals: ") + std::strerror(errno));
    fcntl(signals[1], F_SETFL, O_NONBLOCK);
    try {
        std::thread(await_signal).detach();
    } catch (const std::system_error& error) {
        throw Error(std::string("no thread can be started: ") + error.what());
    }
    std::signal(SIGBUS, handle_lost_bytes);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction action {};
        sigaction(signal, nullptr, &action);
        if (action.sa_handler == SIG_IGN) continue;
        action.sa_handler = handle;
        action.sa_flags = SA_RESTART;
        sigaction(signal, &action, nullptr);
    }
}

} // namespace afterglow
