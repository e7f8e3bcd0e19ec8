#include "viewer/precompute_task.h"

#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace afterglow {
namespace {

/// The processes on whose command line a file is named.
std::vector<pid_t> processes_with(const std::string& file) {
    std::vector<pid_t> found;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
        const std::string name = entry.path().filename();
        if (name.find_first_not_of("0123456789") != std::string::npos) continue;
        std::ifstream words(entry.path() / "cmdline");
        for (std::string word; std::getline(words, word, '\0');)
            if (word == file) found.push_back(static_cast<pid_t>(std::stol(name)));
    }
    return found;
}

/// Those of a file, once there are so many.
std::vector<pid_t> await_processes(const std::string& file, std::size_t count) {
    for (int k = 0; k < 1000 && processes_with(file).size() != count; ++k)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return processes_with(file);
}

/// All that a task says, until it ends.
std::set<std::string> await_end(PrecomputeTask& task) {
    std::set<std::string> said;
    while (task.state() == PrecomputeTask::State::at_work && task.seconds() < 120.0) {
        said.insert(task.message());
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return said;
}

TEST(PrecomputeTask, TellsItsProgressAndMakesTheFile) {
    const TemporaryFolder folder;
    PrecomputeTask task("builtin:cornell", folder.path("cornell.afterglow"));
    const std::set<std::string> said = await_end(task);
    EXPECT_EQ(task.state(), PrecomputeTask::State::done);
    EXPECT_TRUE(std::filesystem::is_regular_file(task.file()));
    int shares = 0;
    for (const std::string& line : said) {
        EXPECT_EQ(line.find_first_of("\r\n\x1b"), std::string::npos);
        shares += line.starts_with("precomputing ") && line.ends_with(" left");
    }
    EXPECT_GE(shares, 3);
}

TEST(PrecomputeTask, SaysWhyItFailed) {
    const TemporaryFolder folder;
    PrecomputeTask task(folder.path("none.obj"), folder.path("none.afterglow"));
    await_end(task);
    EXPECT_EQ(task.state(), PrecomputeTask::State::failed);
    EXPECT_NE(task.message().find("none.obj"), std::string::npos) << task.message();
}

TEST(PrecomputeTask, LeavesNothingWhereItIsStopped) {
    const TemporaryFolder folder;
    {
        PrecomputeTask task("builtin:cornell", folder.path("cornell.afterglow"));
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder.path("")));
}

TEST(PrecomputeTask, IsToldThatItWasKilledByASignal) {
    const TemporaryFolder folder;
    PrecomputeTask task("builtin:cornell", folder.path("cornell.afterglow"));
    const std::vector<pid_t> found = await_processes(task.file(), 1);
    ASSERT_EQ(found.size(), 1u);
    kill(found[0], SIGKILL);
    await_end(task);
    EXPECT_EQ(task.state(), PrecomputeTask::State::failed);
    EXPECT_NE(task.message().find("killed by signal 9"), std::string::npos) << task.message();
}

TEST(PrecomputeTask, EndsWithTheProcessThatStartedIt) {
    const TemporaryFolder folder;
    const std::string file = folder.path("cornell.afterglow");
    const pid_t viewer = fork();
    if (viewer == 0) {
        std::signal(SIGHUP, SIG_IGN); // as under nohup
        const PrecomputeTask task("builtin:cornell", file, 1);
        pause();
    }
    EXPECT_EQ(await_processes(file, 1).size(), 1u);
    kill(viewer, SIGKILL);
    waitpid(viewer, nullptr, 0);
    EXPECT_EQ(await_processes(file, 0).size(), 0u);
    EXPECT_FALSE(std::filesystem::exists(file));
}

} // namespace
} // namespace afterglow
