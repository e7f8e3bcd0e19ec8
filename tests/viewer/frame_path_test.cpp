#include "viewer/frame_path.h"

#include "core/error.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <string>

namespace afterglow {
namespace {

const std::string first = R"({"time": 1, "camera": {"position": [1,2,3], "target": [0,0,0]},
    "light": {"position": [4,5,6], "direction": [0,-2,0], "cone": [10,20], "intensity": [1,2,3]}})";

TEST(FramePath, SaysOnlyWhatChanges) {
    const TemporaryFolder folder;
    const auto frames = read_frame_path(folder.write("path.json", "[" + first + R"(, {"time": 2, "light": {"cone": [5, 6]}}])"));
    ASSERT_EQ(frames.size(), 2u);
    EXPECT_EQ(frames[0].light.direction, Vec3(0.0f, -1.0f, 0.0f)); // of unit length
    EXPECT_EQ(frames[1].camera.position, Vec3(1.0f, 2.0f, 3.0f));
    EXPECT_EQ(frames[1].light.position, Vec3(4.0f, 5.0f, 6.0f));
    EXPECT_EQ(frames[1].light.outer_angle, 6.0f);
    EXPECT_EQ(frames[1].time, 2.0);
}

TEST(FramePath, IsReadAsItWasWritten) {
    const TemporaryFolder folder;
    Frame a;
    a.camera.target = {0.1f, 0.2f, 0.3f};
    a.light.position = {1.0f / 3.0f, 0.0f, -7.25f};
    Frame b = a;
    b.time = 0.04;
    b.camera.vertical_fov = 33.3f;
    b.light.intensity = {0.1f, 0.2f, 0.3f};
    const std::string path = folder.path("recorded.json");
    write_frame_path(path, {a, b});
    const auto frames = read_frame_path(path);
    ASSERT_EQ(frames.size(), 2u);
    EXPECT_EQ(frames[0].camera.target, a.camera.target);
    EXPECT_EQ(frames[0].light.position, a.light.position);
    EXPECT_EQ(frames[1].camera.vertical_fov, b.camera.vertical_fov);
    EXPECT_TRUE((frames[1].light.intensity == b.light.intensity).all());
    EXPECT_EQ(frames[1].time, b.time);
}

TEST(FramePath, GoesFromFrameToFrame) {
    Frame a, b;
    a.light.direction = Vec3::UnitX();
    b.light.direction = Vec3::UnitY();
    b.time = 2.0;
    b.camera.position = {4.0f, 0.0f, 0.0f};
    const Frame half = frame_at({a, b}, 1.0);
    EXPECT_EQ(half.camera.position, Vec3(2.0f, 0.0f, 0.0f));
    EXPECT_NEAR(half.light.direction.norm(), 1.0f, 1e-6f);
    EXPECT_NEAR(half.light.direction.x(), half.light.direction.y(), 1e-6f);
    EXPECT_EQ(frame_at({a, b}, -1.0).camera.position, a.camera.position);
    EXPECT_EQ(frame_at({a, b}, 3.0).camera.position, b.camera.position);
}

TEST(FramePath, NamesTheFrameAndWhatIsWrongInIt) {
    const TemporaryFolder folder;
    const auto message = [&](const std::string& text) -> std::string {
        try {
            read_frame_path(folder.write("path.json", text));
        } catch (const FileError& error) {
            return error.what();
        }
        return "";
    };
    const auto expect = [&](const std::string& text, const std::string& words) {
        EXPECT_NE(message(text).find(words), std::string::npos) << text << " says: " << message(text);
    };
    expect("", "is no JSON");
    expect("[", "is no JSON");
    expect("{}", "array of frames");
    expect("[]", "array of frames");
    expect("[3]", "frame 0: is not an object");
    expect("[{}]", "\"camera\" is missing");
    expect("[" + first + R"(, {"time": 0}])", "frame 1: \"time\" falls");
    expect("[" + first + R"(, {"lamp": 0}])", "unknown name \"lamp\"");
    expect("[" + first + R"(, {"camera": {"position": [1, 2]}}])", "frame 1, camera: \"position\" must be 3 numbers");
    expect("[" + first + R"(, {"camera": {"position": [1, 2, null]}}])", "finite numbers");
    expect("[" + first + R"(, {"camera": {"position": [1, 2, NaN]}}])", "is no JSON");
    expect("[" + first + R"(, {"camera": {"position": [1, 2, 1e300]}}])", "finite numbers");
    expect("[" + first + R"(, {"camera": {"fov": 200}}])", "field of view");
    expect("[" + first + R"(, {"light": {"cone": [30, 20]}}])", "cone");
    expect("[" + first + R"(, {"light": {"direction": [0, 0, 0]}}])", "direction");
    EXPECT_THROW(read_frame_path(folder.path("none.json")), FileError);
}

} // namespace
} // namespace afterglow
