#include "transport/display_patches.h"

#include "core/camera.h"
#include "core/parallel.h"
#include "tests/support/small_transfer.h"
#include "transport/display.h"
#include "transport/display_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

/// The Cornell box, its operator and indirect light.
struct PatchExample : SmallTransfer {
    ShepardBasis basis{transfer.points, surface, true, transfer.points.levels() - 1};
    VectorIrradiance field;

    PatchExample() : SmallTransfer{medium_options()} {
        Spotlight light{.position = *scene.viewpoint, .direction = Vec3(0.3f, -0.5f, 1.0f)};
        light.check();
        field = LightTransport(transfer, surface).indirect(light);
    }
    int level() const { return transfer.points.levels() - 1; }
};

const PatchExample& cornell() {
    static const PatchExample example;
    return example;
}

/// What a camera shows, found by rays.
struct Pixels {
    Camera camera;
    std::vector<PixelSurfaces::Float4> position, normal;
    std::vector<std::uint32_t> surface;

    Pixels(const Surface& scene, const Camera& c) : camera(c) {
        for (int y = 0; y < c.height; ++y)
            for (int x = 0; x < c.width; ++x) {
                const Hit hit = scene.closest_hit(
                    {c.position, c.direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)});
                const SurfacePoint p = hit ? scene.point(hit) : SurfacePoint{};
                position.push_back({p.position.x(), p.position.y(), p.position.z(), 1.0f});
                normal.push_back({p.normal.x(), p.normal.y(), p.normal.z(), 0.0f});
                surface.push_back(hit ? 2 * hit.primitive + hit.back_side : no_index);
            }
    }
    PixelSurfaces view() const {
        return {camera.width, camera.height, camera.position, camera.pixel_size(), position, normal, surface};
    }
};

Camera cornell_camera(int width = 160, int height = 120) {
    return {.position = {0.278f, 0.273f, -0.8f}, .target = {0.278f, 0.273f, 0.0f},
            .width = width, .height = height};
}

std::vector<PixelSurfaces::Float4> read(const PatchExample& example, const Pixels& pixels,
                                        const DisplayPatches& patches,
                                        const std::vector<std::uint32_t>& patch) {
    DisplayField field(example.transfer.points);
    field.set(example.field);
    std::vector<PixelSurfaces::Float4> result(pixels.surface.size());
    field.irradiance(pixels.view(), patches, patch, pixels.normal, result);
    return result;
}

/// Root mean square difference to Display over its mean; uncovered pixels must agree.
double relative_error(const PatchExample& example, const Pixels& pixels,
                      const std::vector<PixelSurfaces::Float4>& result) {
    const Display display(example.transfer, example.surface);
    double squares = 0.0, mean = 0.0;
    for (std::size_t p = 0; p < result.size(); ++p) {
        if (pixels.surface[p] == no_index) {
            EXPECT_EQ(result[p], PixelSurfaces::Float4{});
            continue;
        }
        bool covered = false;
        const Rgb expected = display.net_irradiance(pixels.view().point(p), example.field, covered).max(0.0f);
        EXPECT_EQ(result[p][3], covered ? 1.0f : 0.0f) << "pixel " << p;
        squares += (Rgb(result[p][0], result[p][1], result[p][2]) - expected).square().sum();
        mean += expected.sum();
    }
    return std::sqrt(squares * 3.0 * static_cast<double>(result.size())) / mean;
}

TEST(DisplayPatches, GiveEachPixelTheIrradianceOfDisplay) {
    const Pixels pixels(cornell().surface, cornell_camera());
    DisplayPatches patches(cornell().basis, cornell().level(), {});
    std::vector<std::uint32_t> patch;
    EXPECT_EQ(patches.find(pixels.view(), DisplayPatches::no_limit, patch), 0u);
    // Rows differ by a tenth at most, and neighbours' irradiance by a tenth or so.
    EXPECT_LT(relative_error(cornell(), pixels, read(cornell(), pixels, patches, patch)), 0.002);
    // One patch has several pixels where nothing is close.
    EXPECT_LT(patches.patches(), pixels.surface.size() / 2);
    // Where four places did not tell, a second look may; a third finds all of them there.
    patches.find(pixels.view(), DisplayPatches::no_limit, patch);
    const std::size_t before = patches.patches();
    patches.find(pixels.view(), DisplayPatches::no_limit, patch);
    EXPECT_EQ(patches.patches(), before);
}

TEST(DisplayPatches, OfAPixelEachAreDisplayItself) {
    const Pixels pixels(cornell().surface, cornell_camera(80, 60));
    DisplayPatches patches(cornell().basis, cornell().level(),
                           {.patch_pixels = 0.05f, .small_pixels = 0.05f});
    std::vector<std::uint32_t> patch;
    patches.find(pixels.view(), DisplayPatches::no_limit, patch);
    EXPECT_LT(relative_error(cornell(), pixels, read(cornell(), pixels, patches, patch)), 2e-4);
}

TEST(DisplayPatches, ComeLittleByLittleToTheSamePicture) {
    const Pixels pixels(cornell().surface, cornell_camera());
    DisplayPatches patches(cornell().basis, cornell().level(), {});
    std::vector<std::uint32_t> patch;
    std::size_t missing = patches.find(pixels.view(), 300, patch);
    // All is there at once, though not as it will be.
    for (std::size_t p = 0; p < patch.size(); ++p)
        EXPECT_EQ(patch[p] == no_index, pixels.surface[p] == no_index);
    EXPECT_LT(relative_error(cornell(), pixels, read(cornell(), pixels, patches, patch)), 0.2);
    int looks = 1;
    for (; missing > 0 && looks < 1000; ++looks) {
        const std::size_t before = patches.patches();
        missing = looks % 2 ? patches.find(pixels.view(), 300, patch)
                            : patches.refine(pixels.view(), 300, patch);
        EXPECT_LE(patches.patches(), before + 300);
    }
    EXPECT_GT(looks, 5);
    EXPECT_EQ(missing, 0u);
    EXPECT_LT(relative_error(cornell(), pixels, read(cornell(), pixels, patches, patch)), 0.002);
}

TEST(DisplayPatches, AreTheSameAtAnyNumberOfThreads) {
    const Pixels pixels(cornell().surface, cornell_camera());
    const auto picture = [&](int threads) {
        const ThreadLimit limit(threads);
        DisplayPatches patches(cornell().basis, cornell().level(), {});
        std::vector<std::uint32_t> patch;
        patches.find(pixels.view(), 1000, patch);
        patches.find(pixels.view(), 1000, patch);
        return read(cornell(), pixels, patches, patch);
    };
    EXPECT_EQ(picture(1), picture(2));
}

TEST(DisplayPatches, ForgetAllWhenThereAreTooMany) {
    // Also where two a pixel are fewer than the most, and where it is small ones that are too many.
    struct Case {
        int width, height;
        std::size_t most;
        double error; // of so few pixels, which are far apart, it is left open
    };
    for (const Case& c : {Case{160, 120, 3000, 0.1}, Case{40, 30, 3000, 1.0}}) {
        DisplayPatches patches(cornell().basis, cornell().level(), {.most_patches = c.most});
        std::vector<std::uint32_t> patch;
        for (int k = 0; k < 40; ++k) {
            Camera camera = cornell_camera(c.width, c.height);
            camera.position.x() = 0.05f + 0.01f * static_cast<float>(k);
            const Pixels pixels(cornell().surface, camera);
            EXPECT_EQ(patches.find(pixels.view(), DisplayPatches::no_limit, patch), 0u) << k;
            EXPECT_LE(patches.patches(), std::max(c.most, 2 * patch.size()));
            EXPECT_LT(relative_error(cornell(), pixels, read(cornell(), pixels, patches, patch)), c.error);
        }
        EXPECT_GT(patches.generation(), 0u);
        EXPECT_EQ(patches.begin().size(), patches.patches() + 1);
        EXPECT_EQ(patches.begin().back(), patches.entries().size());
    }
}

TEST(DisplayPatches, AreTheSameFromWhereverACameraComes) {
    // Small patches seen from afar are as large as large ones of a camera sixteen times as close.
    const auto camera_at = [](float distance) {
        Camera camera = cornell_camera();
        const Vec3 at(0.13f, 0.0f, 0.09f); // the foot of a block
        camera.position = at + distance * Vec3(0.3f, 0.5f, -1.0f).normalized();
        camera.target = at;
        return camera;
    };
    const Pixels far(cornell().surface, camera_at(1.6f)), close(cornell().surface, camera_at(0.1f));
    DisplayPatches alone(cornell().basis, cornell().level(), {}), after(cornell().basis, cornell().level(), {});
    std::vector<std::uint32_t> patch;
    alone.find(close.view(), DisplayPatches::no_limit, patch);
    const auto expected = read(cornell(), close, alone, patch);
    after.find(far.view(), DisplayPatches::no_limit, patch);
    after.find(close.view(), DisplayPatches::no_limit, patch);
    const auto found = read(cornell(), close, after, patch);
    double squares = 0.0, mean = 0.0;
    for (std::size_t p = 0; p < found.size(); ++p)
        for (std::size_t c = 0; c < 3; ++c) {
            squares += std::pow(found[p][c] - expected[p][c], 2);
            mean += expected[p][c];
        }
    EXPECT_LT(std::sqrt(squares * 3.0 * static_cast<double>(found.size())) / mean, 3e-4);
}

TEST(DisplayPatches, NeedNoSurface) {
    Camera camera = cornell_camera(8, 8);
    camera.target = {0.278f, 0.273f, -2.0f}; // away from the box
    const Pixels pixels(cornell().surface, camera);
    DisplayPatches patches(cornell().basis, cornell().level(), {});
    std::vector<std::uint32_t> patch;
    EXPECT_EQ(patches.find(pixels.view(), DisplayPatches::no_limit, patch), 0u);
    EXPECT_EQ(patches.patches(), 0u);
    for (const PixelSurfaces::Float4& pixel : read(cornell(), pixels, patches, patch))
        EXPECT_EQ(pixel, PixelSurfaces::Float4{});
}

} // namespace
} // namespace afterglow
