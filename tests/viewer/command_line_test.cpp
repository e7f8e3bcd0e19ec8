#include "core/image.h"
#include "tests/support/small_transfer.h"

#include "tests/support/program.h" // its `light` must not come before others' parameters

#include <gtest/gtest.h>

#include <chrono>
#include <numeric>
#include <string>
#include <vector>

// Runs afterglow-view itself.

namespace afterglow {
namespace {

const std::string path_text = R"([{"camera": {"position": [0.278, 0.273, -0.8], "target": [0.278, 0.273, 0]},
    "light": {"position": [0.278, 0.5, 0.28], "direction": [0, -1, 0]}},
    {"time": 1, "light": {"position": [0.3, 0.5, 0.28]}}])";

/// A folder with a transfer file of the Cornell box and a path.
struct Files {
    TemporaryFolder folder;
    std::string file = folder.path("cornell.afterglow");
    std::string frames = folder.write("path.json", path_text);

    Files() {
        save_transfer(file, small_transfer().transfer, small_transfer().provenance);
    }
    std::string frame_options(const std::string& output) const {
        return " --headless --frames '" + frames + "' -o '" + folder.path(output) + "' --size 64x48 ";
    }
};

void expect_one_line(const Outcome& run, int status, const std::string& words) {
    EXPECT_EQ(run.status, status) << run.err;
    EXPECT_TRUE(run.err.starts_with("afterglow-view: ")) << run.err;
    EXPECT_EQ(run.err.find('\n'), run.err.size() - 1) << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
}

TEST(CommandLine, DrawsAPictureAFrameAndItsTimings) {
    const Files files;
    for (const char* context : {"egl", "osmesa"}) {
        const Outcome outcome = run("'" + files.file + "'" + files.frame_options(context) + "--context " + context);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        EXPECT_EQ(outcome.err, "");
        const std::string folder = files.folder.path(context);
        EXPECT_FALSE(content_of(folder + "/frame_0000.png").empty());
        EXPECT_FALSE(content_of(folder + "/frame_0001.png").empty());
        const std::string timings = content_of(folder + "/timings.json");
        for (const char* name : {"frame_0001.png", "\"light\"", "\"indirect\"", "\"geometry\""})
            EXPECT_NE(timings.find(name), std::string::npos) << name;
    }
    EXPECT_EQ(content_of(files.folder.path("egl") + "/frame_0001.png"),
              content_of(files.folder.path("osmesa") + "/frame_0001.png"));
}

TEST(CommandLine, DrawsTheSameBytesAtAnyNumberOfThreads) {
    const Files files;
    for (const char* threads : {"1", "2"})
        EXPECT_EQ(run("'" + files.file + "'" + files.frame_options(threads) + "--indirect gather --format exr --threads " + threads).status, 0);
    EXPECT_EQ(content_of(files.folder.path("1") + "/frame_0001.exr"), content_of(files.folder.path("2") + "/frame_0001.exr"));
}

TEST(CommandLine, ALampInItsCeilingShinesAsOneBelowIt) {
    const Files files;
    const auto lit_by_lamp_at = [&](const std::string& height) {
        const std::string path = files.folder.write(height + ".json",
            R"([{"camera": {"position": [0.278, 0.273, -0.8], "target": [0.278, 0.273, 0]},
                 "light": {"position": [0.278, )" + height + R"(, 0.28], "direction": [0, -1, 0], "cone": [60, 80]}}])");
        const std::string output = files.folder.path(height);
        EXPECT_EQ(run("'" + files.file + "' --headless --frames '" + path + "' -o '" + output + "' --size 64x48 --format exr").status, 0);
        const std::vector<float> rgb = read_exr(output + "/frame_0000.exr").rgb;
        return std::accumulate(rgb.begin(), rgb.end(), 0.0f) / static_cast<float>(rgb.size());
    };
    const float below = lit_by_lamp_at("0.547");
    EXPECT_GT(below, 0.0f);
    EXPECT_NEAR(lit_by_lamp_at("0.5488001"), below, 0.02f * below);
}

TEST(CommandLine, DrawsThePathUntilTheTimeHasPassed) {
    const Files files;
    const auto seconds = [start = std::chrono::steady_clock::now()] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    EXPECT_EQ(run("'" + files.file + "'" + files.frame_options("again") + "--seconds 1").status, 0);
    EXPECT_GE(seconds(), 1.0);
    EXPECT_FALSE(content_of(files.folder.path("again") + "/frame_0001.png").empty());
    EXPECT_FALSE(content_of(files.folder.path("again") + "/timings.json").empty());
}

TEST(CommandLine, SaysInOneLineWhatIsWrong) {
    const Files files;
    const std::string open = "'" + files.file + "'", draw = files.frame_options("out");
    expect_one_line(run("none.afterglow" + draw), 1, "none.afterglow");
    const std::string damaged = files.folder.write("damaged.afterglow", content_of(files.file).substr(0, 5000));
    expect_one_line(run("'" + damaged + "'" + draw), 1, "damaged.afterglow");
    expect_one_line(run(open + " --scene none.obj" + draw), 1, "none.obj");
    files.folder.write("path.json", R"([{"camera": {"position": [NaN, 0, 0]}}])");
    expect_one_line(run(open + draw), 1, "path.json");
    files.folder.write("path.json", path_text);
    expect_one_line(run(open + " --headless -o out"), 2, "--frames");
    files.folder.write("timings.json", path_text);
    expect_one_line(run(open + " --headless --frames '" + files.folder.path("timings.json") + "' -o '" + files.folder.path("") + "'"), 2, "timings.json");
    expect_one_line(run("room.obj --scene other.obj"), 2, "--scene");
    expect_one_line(run(open + draw + "--context glfw"), 2, "no window");
    expect_one_line(run(open + draw + "--indirect magic"), 2, "splat, gather or auto");
    expect_one_line(run(open + draw + "--layer depth"), 2, "reflectance");
    expect_one_line(run(open + draw + "--size 0x5"), 2, "--size");
    expect_one_line(run(open + draw + "--exposure 0"), 2, "--exposure");
    expect_one_line(run(open + draw + "--seconds -1"), 2, "--seconds");
    expect_one_line(run(open + " --context egl"), 2, "no window");
    expect_one_line(run(open, "unset DISPLAY WAYLAND_DISPLAY; "), 1, "no window");
    // No OpenGL at all but in memory: that is enough, unless something else is asked for.
    const std::string no_egl = "export __EGL_VENDOR_LIBRARY_FILENAMES=/nowhere; ";
    EXPECT_EQ(run(open + draw, no_egl).status, 0);
    expect_one_line(run(open + draw + "--context egl", no_egl), 1, "EGL");
}

TEST(CommandLine, WritesNothingWhereItCannot) {
    const Files files;
    const std::string taken = files.folder.write("taken", "a file");
    expect_one_line(run("'" + files.file + "' --headless --frames '" + files.frames + "' -o '" + taken + "'"), 1, "taken");
    EXPECT_EQ(content_of(taken), "a file");
}

} // namespace
} // namespace afterglow
