#include "viewer/camera_control.h"
#include "viewer/light_control.h"

#include "transport/cli_options.h"
#include "viewer/overlays.h"

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

Camera camera_at(const Vec3& position, const Vec3& target) {
    return {.position = position, .target = target, .vertical_fov = 60.0f, .width = 800, .height = 600};
}

TEST(CameraControl, OrbitKeepsTheDistanceToThePivotAndItsPlaceInThePicture) {
    Camera camera = camera_at({3.0f, 1.0f, 2.0f}, {0.0f, 0.5f, 0.0f});
    const Vec3 pivot(0.5f, 0.2f, -0.4f);
    const float distance = (camera.position - pivot).norm();
    const Vec2 place = *project(camera, pivot);
    orbit(camera, pivot, 0.7f, 0.2f);
    EXPECT_NEAR((camera.position - pivot).norm(), distance, 1e-4f);
    EXPECT_LT((*project(camera, pivot) - place).norm(), 0.1f); // pixels
}

TEST(CameraControl, NeverTipsOver) {
    for (const float upwards : {10.0f, -10.0f}) {
        Camera camera = camera_at({3.0f, 1.0f, 2.0f}, {0.0f, 0.5f, 0.0f});
        for (int k = 0; k < 100; ++k) orbit(camera, Vec3::Zero(), 0.1f, upwards);
        for (int k = 0; k < 100; ++k) look(camera, 0.1f, upwards);
        EXPECT_NO_THROW(camera.check());
        EXPECT_LT(std::abs(camera.forward().y()), 0.9999f);
    }
}

TEST(CameraControl, PanMovesWhatLiesAtTheTargetWithThePointer) {
    Camera camera = camera_at({3.0f, 1.0f, 2.0f}, {0.0f, 0.5f, 0.0f});
    const Vec3 target = camera.target;
    pan(camera, 0.1f, 0.2f); // of 600 pixels
    const Vec2 moved = *project(camera, target) - Vec2(400.0f, 300.0f);
    EXPECT_NEAR(moved.x(), 60.0f, 0.1f);
    EXPECT_NEAR(moved.y(), -120.0f, 0.1f);
}

TEST(CameraControl, ZoomHoldsThePlaceThatItGoesTo) {
    Camera camera = camera_at({3.0f, 1.0f, 2.0f}, {0.0f, 0.5f, 0.0f});
    const Vec3 place(0.3f, 0.1f, 0.2f);
    const Vec2 before = *project(camera, place);
    zoom(camera, place, 0.5f);
    EXPECT_LT((*project(camera, place) - before).norm(), 0.1f);
}

TEST(CameraControl, FlyGoesWhereTheCameraLooks) {
    Camera camera = camera_at(Vec3::Zero(), {0.0f, 0.0f, -2.0f});
    fly(camera, 1.0f, 2.0f, 3.0f);
    EXPECT_LT((camera.position - Vec3(1.0f, 2.0f, -3.0f)).norm(), 1e-5f);
    EXPECT_LT((camera.forward() + Vec3::UnitZ()).norm(), 1e-5f);
}

TEST(CameraControl, WhatCannotBeLeavesTheCameraAsItWas) {
    Camera camera = camera_at({3.0f, 1.0f, 2.0f}, {0.0f, 0.5f, 0.0f});
    const Vec3 position = camera.position, target = camera.target;
    fly(camera, std::numeric_limits<float>::quiet_NaN(), 0.0f, 0.0f);
    zoom(camera, Vec3::Zero(), 0.0f);
    EXPECT_EQ(camera.position, position);
    EXPECT_EQ(camera.target, target);
}

TEST(LightControl, MovesWithThePointer) {
    const Camera camera = camera_at({0.0f, 0.0f, 5.0f}, Vec3::Zero());
    Spotlight light{.position = {0.3f, 0.2f, 1.0f}};
    const Vec2 before = *project(camera, light.position);
    move_along_view(light, camera, 0.1f, 0.05f);
    const Vec2 moved = *project(camera, light.position) - before;
    EXPECT_NEAR(moved.x(), 60.0f, 0.1f);
    EXPECT_NEAR(moved.y(), -30.0f, 0.1f);
    EXPECT_NEAR(light.position.z(), 1.0f, 1e-5f);
}

TEST(LightControl, AimsAndWidensAndGoesToTheCamera) {
    const Camera camera = camera_at({0.0f, 0.0f, 5.0f}, Vec3::Zero());
    Spotlight light{.position = {0.0f, 2.0f, 0.0f}, .inner_angle = 20.0f, .outer_angle = 40.0f};
    aim(light, {0.0f, 2.0f, -3.0f});
    EXPECT_LT((light.direction + Vec3::UnitZ()).norm(), 1e-6f);
    const Vec3 direction = light.direction;
    aim(light, light.position); // nowhere
    EXPECT_EQ(light.direction, direction);
    widen(light, 2.0f);
    EXPECT_NEAR(light.outer_angle, 80.0f, 1e-4f);
    EXPECT_NEAR(light.inner_angle, 40.0f, 1e-4f);
    for (int k = 0; k < 50; ++k) widen(light, 1.5f);
    EXPECT_LE(light.outer_angle, 180.0f);
    for (int k = 0; k < 50; ++k) widen(light, 0.5f);
    EXPECT_GT(light.outer_angle, 0.0f);
    for (int tenths = 5; tenths < 1600; ++tenths) // a hard cone stays so, however angles round
        for (const float factor : {1.1f, 1.0f / 1.1f}) {
            Spotlight hard = light;
            hard.inner_angle = hard.outer_angle = 0.1f * static_cast<float>(tenths);
            const float before = hard.outer_angle;
            widen(hard, factor);
            EXPECT_NE(hard.outer_angle, before == 0.5f ? 0.0f : before);
            EXPECT_EQ(hard.inner_angle, hard.outer_angle);
        }
    put_at_camera(light, camera);
    EXPECT_EQ(light.position, camera.position);
    EXPECT_LT((light.direction + Vec3::UnitZ()).norm(), 1e-6f);
}

TEST(LightControl, ItsCommandLineIsReadAsItWas) {
    const Camera camera = camera_at({1.0f / 3.0f, 1e-7f, 2e6f}, {0.0f, 0.5f, 0.0f});
    Spotlight light{.position = {-0.1f, 2.0f, 0.7f}, .direction = {0.6f, -0.8f, 0.0f}, .inner_angle = 12.3f,
                    .outer_angle = 45.6f, .intensity = {0.1f, 20.0f, 3e-4f}};
    CLI::App app;
    Camera read_camera;
    Spotlight read_light;
    add_camera_options(app, read_camera, true);
    add_light_options(app, read_light);
    app.parse(command_line(camera, light));
    EXPECT_EQ(read_camera.position, camera.position);
    EXPECT_EQ(read_camera.target, camera.target);
    EXPECT_EQ(read_camera.vertical_fov, camera.vertical_fov);
    EXPECT_EQ(read_camera.width, camera.width);
    EXPECT_EQ(read_light.position, light.position);
    EXPECT_EQ(read_light.direction, light.direction);
    EXPECT_EQ(read_light.outer_angle, light.outer_angle);
    EXPECT_TRUE((read_light.intensity == light.intensity).all());
}

} // namespace
} // namespace afterglow
