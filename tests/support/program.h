#pragma once

#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <sys/wait.h>

// Runs the program itself, whose path is AFTERGLOW_PROGRAM.

namespace afterglow {

struct Outcome {
    int status = -1;
    std::string out, err;
};

/// `before`: shell commands that run first, in the same shell.
inline Outcome run(const std::string& arguments, const std::string& before = "") {
    const TemporaryFolder streams;
    const std::string command = before + "'" + AFTERGLOW_PROGRAM + "' " + arguments + " >'"
                                + streams.path("out") + "' 2>'" + streams.path("err")
                                + "' </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, content_of(streams.path("out")),
            content_of(streams.path("err"))};
}

/// An error is one line that says who speaks.
inline void expect_failure(const Outcome& run, int status) {
    EXPECT_EQ(run.status, status) << run.err;
    EXPECT_EQ(run.out, "");
    EXPECT_TRUE(run.err.starts_with("afterglow: ")) << run.err;
    EXPECT_EQ(run.err.find('\n'), run.err.size() - 1) << run.err;
}

/// A light and a camera for builtin:cornell.
inline const std::string light = " --light-position 0.278,0.54,0.28 --light-direction 0,-1,0"
                                 " --light-cone 40,45 --light-intensity 1,1,1";
inline const std::string camera =
    " --camera-position 0.278,0.273,-0.8 --camera-target 0.278,0.273,0"
    " --camera-fov 38 --size 16x12";

} // namespace afterglow
