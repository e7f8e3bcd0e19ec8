#include "viewer/precompute_task.h"

#include "core/error.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace afterglow {
namespace {

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string program() {
    std::error_code none;
    const std::filesystem::path here = std::filesystem::read_symlink("/proc/self/exe", none).parent_path();
    // Installed side by side, or as they are built.
    for (const auto& path : {here / "afterglow", here / "../transport/afterglow"})
        if (std::filesystem::is_regular_file(path, none)) return path.string();
    return "afterglow";
}

} // namespace

PrecomputeTask::PrecomputeTask(const std::string& scene, const std::string& file)
    : file_(file), start_(now()) {
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0)
        throw Error(std::string("no pipe to the precomputation: ") + std::strerror(errno));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
    const std::string path = program();
    const std::array<const char*, 6> words = {path.c_str(), "precompute", scene.c_str(), "-o", file.c_str(), nullptr};
    const int failure = posix_spawnp(&process_, path.c_str(), &actions, nullptr,
                                     const_cast<char**>(words.data()), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    output_ = ends[0];
    if (failure != 0) {
        close(output_);
        throw Error("the program " + path + " cannot be started: " + std::strerror(failure));
    }
}

PrecomputeTask::~PrecomputeTask() {
    if (state_ == State::at_work) {
        kill(process_, SIGTERM);
        waitpid(process_, nullptr, 0);
    }
    close(output_);
}

double PrecomputeTask::seconds() const { return now() - start_; }

void PrecomputeTask::read_output() {
    std::array<char, 512> text{};
    for (ssize_t count = 0; (count = read(output_, text.data(), text.size())) > 0;)
        message_.append(text.data(), static_cast<std::size_t>(count));
    while (message_.ends_with('\n')) message_.pop_back();
    if (const auto line = message_.rfind('\n'); line != std::string::npos) message_.erase(0, line + 1);
}

PrecomputeTask::State PrecomputeTask::state() {
    if (state_ != State::at_work) return state_;
    read_output();
    int status = 0;
    if (waitpid(process_, &status, WNOHANG) != process_) return state_;
    read_output();
    state_ = WIFEXITED(status) && WEXITSTATUS(status) == 0 ? State::done : State::failed;
    return state_;
}

} // namespace afterglow
