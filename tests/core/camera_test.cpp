#include "core/camera.h"
#include "core/error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace afterglow {
namespace {

Camera sample_camera() {
    Camera camera;
    camera.position = {1, 2, 3};
    camera.target = {4, 1, -2};
    camera.vertical_fov = 60.0f;
    camera.width = 300;
    camera.height = 200;
    return camera;
}

TEST(Camera, LooksAtItsTargetThroughTheCentre) {
    const Camera camera = sample_camera();
    const Vec3 forward = (camera.target - camera.position).normalized();
    EXPECT_LT((camera.direction(150, 100) - forward).norm(), 1e-6f);
}

TEST(Camera, SpansItsFieldOfViewFromTopToBottom) {
    const Camera camera = sample_camera();
    const float cosine = camera.direction(150, 0).dot(camera.direction(150, 200));
    EXPECT_NEAR(std::acos(cosine) * 180.0 / EIGEN_PI, 60.0, 1e-3);
}

TEST(Camera, HasItsFirstPixelAtTheTopLeft) {
    Camera camera; // looks along -z, up is y, so right is x
    const Vec3 d = camera.direction(0.5f, 0.5f);
    EXPECT_LT(d.x(), 0.0f);
    EXPECT_GT(d.y(), 0.0f);
    EXPECT_LT(d.z(), 0.0f);
}

TEST(Camera, HasSquarePixelsAndUnitDirections) {
    const Camera camera = sample_camera();
    const Vec3 forward = camera.direction(150, 100);
    const auto on_plane = [&](float x, float y) -> Vec3 {
        const Vec3 d = camera.direction(x, y);
        EXPECT_NEAR(d.norm(), 1.0f, 1e-6f);
        return d / d.dot(forward);
    };
    const float across = (on_plane(290, 100) - on_plane(200, 100)).norm();
    const float down = (on_plane(150, 190) - on_plane(150, 100)).norm();
    EXPECT_NEAR(across, down, 1e-5f);
}

TEST(Camera, RefusesUndefinedViews) {
    EXPECT_NO_THROW(sample_camera().check());
    const auto refused = [](auto change) {
        Camera camera = sample_camera();
        change(camera);
        EXPECT_THROW(camera.check(), UsageError);
    };
    const float nan = std::numeric_limits<float>::quiet_NaN();
    refused([](Camera& c) { c.target = c.position; });
    refused([](Camera& c) { c.up = c.target - c.position; });
    refused([](Camera& c) { c.up.setZero(); });
    refused([](Camera& c) { c.vertical_fov = 0; });
    refused([](Camera& c) { c.vertical_fov = 180; });
    refused([&](Camera& c) { c.vertical_fov = nan; });
    refused([&](Camera& c) { c.position.x() = nan; });
    refused([&](Camera& c) { c.target.y() = std::numeric_limits<float>::infinity(); });
    refused([](Camera& c) { c.width = 0; });
    refused([](Camera& c) { c.height = -5; });
    refused([](Camera& c) { c.width = 1 << 30; });
}

} // namespace
} // namespace afterglow
