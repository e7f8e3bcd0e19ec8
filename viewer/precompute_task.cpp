#include "viewer/precompute_task.h"

#include "core/error.h"
#include "core/seconds.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <spawn.h>
#include <string_view>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace afterglow {
namespace {

std::string program() {
    std::error_code none;
    const std::filesystem::path here = std::filesystem::read_symlink("/proc/self/exe", none).parent_path();
    // Installed side by side, or as they are built.
    for (const auto& path : {here / "afterglow", here / "../transport/afterglow"})
        if (std::filesystem::is_regular_file(path, none)) return path.string();
    return "afterglow";
}

} // namespace

PrecomputeTask::PrecomputeTask(const std::string& scene, const std::string& file, int threads)
    : file_(file), start_(clock_seconds()) {
    // A terminal of its own, to which it tells its progress as it would to a person's; as its controlling one, so that
    // it is hung up (SIGHUP) where this process is gone, however that came.
    const int here = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    const char* name = here >= 0 && grantpt(here) == 0 && unlockpt(here) == 0 ? ptsname(here) : nullptr;
    if (!name) {
        const std::string why = std::strerror(errno);
        if (here >= 0) close(here);
        throw Error("no terminal for the precomputation: " + why);
    }
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, name, O_RDWR, 0);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGDEF);
    sigset_t followed;
    sigemptyset(&followed);
    sigaddset(&followed, SIGHUP);
    posix_spawnattr_setsigdefault(&attributes, &followed);
    const std::string path = program(), count = std::to_string(threads);
    const std::array<const char*, 8> words = {path.c_str(), "precompute", scene.c_str(), "-o", file.c_str(),
                                              "--threads", count.c_str(), nullptr};
    const int failure = posix_spawnp(&process_, path.c_str(), &actions, &attributes,
                                     const_cast<char**>(words.data()), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    output_ = here;
    if (failure != 0) {
        close(output_);
        throw Error("the program " + path + " cannot be started: " + std::strerror(failure));
    }
}

PrecomputeTask::~PrecomputeTask() {
    stop();
    if (state_ == State::at_work) waitpid(process_, nullptr, 0);
    close(output_);
}

void PrecomputeTask::stop() {
    if (process_ > 0 && state_ == State::at_work) kill(process_, SIGTERM);
}

double PrecomputeTask::seconds() const { return clock_seconds() - start_; }

void PrecomputeTask::read_output() {
    std::array<char, 512> text{};
    for (ssize_t count = 0; (count = read(output_, text.data(), text.size())) > 0;)
        written_.append(text.data(), static_cast<std::size_t>(count));
    constexpr std::string_view wipe = "\x1b[K"; // of a line that Progress draws again
    for (std::size_t at = 0; (at = written_.find(wipe)) != std::string::npos;) written_.erase(at, wipe.size());
    // The last line that says something; what comes after it may not be complete.
    constexpr std::string_view ends = "\r\n";
    for (std::size_t end = 0; (end = written_.find_first_of(ends)) != std::string::npos;) {
        if (end > 0) message_ = written_.substr(0, end);
        written_.erase(0, end + 1);
    }
    if (!written_.empty()) message_ = written_;
}

PrecomputeTask::State PrecomputeTask::state() {
    if (state_ != State::at_work) return state_;
    read_output();
    int status = 0;
    if (waitpid(process_, &status, WNOHANG) != process_) return state_;
    read_output();
    state_ = WIFEXITED(status) && WEXITSTATUS(status) == 0 ? State::done : State::failed;
    constexpr std::string_view own = "afterglow: "; // it is told by this program
    if (message_.starts_with(own)) message_.erase(0, own.size());
    if (WIFSIGNALED(status)) message_ = "the precomputation was killed by signal " + std::to_string(WTERMSIG(status));
    return state_;
}

} // namespace afterglow
