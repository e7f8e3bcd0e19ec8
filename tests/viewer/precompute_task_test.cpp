#include "viewer/precompute_task.h"

#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <set>
#include <string>
#include <thread>

namespace afterglow {
namespace {

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

} // namespace
} // namespace afterglow
