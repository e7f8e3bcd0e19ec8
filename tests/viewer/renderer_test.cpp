#include "viewer/renderer.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/tone_map.h"
#include "tests/support/small_transfer.h"
#include "tests/support/temporary_folder.h"
#include "transport/renderer.h"
#include "viewer/gl_context.h"
#include "viewer/light_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

namespace afterglow {
namespace {

/// A transfer scene on disk, made once a scene.
const TransferScene& opened(const std::string& scene_name) {
    static std::map<std::string, std::unique_ptr<TransferScene>> all;
    static const TemporaryFolder folder;
    auto& scene = all[scene_name];
    if (!scene) {
        const Scene source = load_scene(scene_name);
        const Surface surface(source);
        PrecomputeOptions options = medium_options();
        options.links.rays = 64;
        const std::string file = folder.path(std::to_string(all.size()) + ".afterglow");
        save_transfer(file, precompute(surface, options),
                      {AFTERGLOW_VERSION, source.name, source.content_hash(), 1, "{}", "{}"});
        scene = std::make_unique<TransferScene>(file);
    }
    return *scene;
}

const std::string cornell = "builtin:cornell";

Camera cornell_camera() {
    return {.position = {0.25f, 0.3f, -0.75f}, .target = {0.28f, 0.26f, 0.0f}, .vertical_fov = 41.0f,
            .width = 240, .height = 180};
}

Spotlight spot(float outer_angle) {
    Spotlight light{.position = {0.3f, 0.5f, 0.2f}, .direction = {-0.1f, -1.0f, 0.2f},
                    .inner_angle = 0.7f * outer_angle, .outer_angle = outer_angle};
    light.check();
    return light;
}

/// relRMSE over pixels that are not left out.
double difference(const Image& a, const Image& b, const std::vector<bool>& left_out = {}) {
    double squares = 0.0, mean = 0.0;
    for (std::size_t k = 0; k < a.rgb.size(); ++k) {
        if (!left_out.empty() && left_out[k / 3]) continue;
        squares += std::pow(static_cast<double>(a.rgb[k]) - b.rgb[k], 2);
        mean += b.rgb[k];
    }
    return std::sqrt(squares * static_cast<double>(a.rgb.size())) / mean;
}

/// Pixels within two of one whose light is cut off where its neighbour's is not.
std::vector<bool> shadow_edges(const Image& direct) {
    const auto lit = [&](int x, int y) { return direct.pixel(x, y).sum() > 0.0f; };
    std::vector<bool> band(direct.rgb.size() / 3);
    for (int y = 0; y + 1 < direct.height; ++y)
        for (int x = 0; x + 1 < direct.width; ++x)
            if (lit(x, y) != lit(x + 1, y) || lit(x, y) != lit(x, y + 1))
                for (int v = std::max(0, y - 2); v <= std::min(direct.height - 1, y + 3); ++v)
                    for (int u = std::max(0, x - 2); u <= std::min(direct.width - 1, x + 3); ++u)
                        band[static_cast<std::size_t>(v) * static_cast<std::size_t>(direct.width) + static_cast<std::size_t>(u)] = true;
    return band;
}

/// Pixels whose ray hits another triangle than the one that is drawn there: along edges, whose ends the
/// rasteriser moves by up to 1/512 of a pixel.
std::vector<bool> other_surfaces(const TransferScene& scene, Renderer& renderer, const Camera& camera) {
    std::vector<bool> other;
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const Hit hit = scene.surface.closest_hit(
                {camera.position, camera.direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)});
            const std::uint32_t surface = renderer.pixels().surface[other.size()];
            other.push_back((surface == no_index ? no_index : renderer.mesh().triangle(surface / 2)) != hit.primitive);
        }
    EXPECT_LT(std::count(other.begin(), other.end(), true), 0.005 * static_cast<double>(other.size()));
    return other;
}

class OnContext : public testing::TestWithParam<const char*> {
protected:
    std::unique_ptr<GlContext> context = make_offscreen_context(GetParam());
    void TearDown() override { EXPECT_TRUE(context->gl().errors().empty()) << context->gl().errors().front(); }
};
INSTANTIATE_TEST_SUITE_P(Renderer, OnContext, testing::Values("egl", "osmesa"));

TEST_P(OnContext, IndirectLightIsThatOfTheRendererOnTheCpu) {
    const TransferScene& scene = opened(cornell);
    const Spotlight light = spot(50.0f);
    const VectorIrradiance field = scene.transport.indirect(light);
    auto lit = std::make_shared<DisplayField>(scene.file.transfer.points);
    lit->set(field);
    const Image expected = render_picture(scene.surface, scene.display, field, light, cornell_camera(), Layer::indirect, 1).image;
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    renderer.set_light(light, lit);
    renderer.draw(cornell_camera(), ViewLayer::indirect);
    const Image gathered = renderer.read();
    renderer.set_method(IndirectMethod::splat);
    renderer.draw(cornell_camera(), ViewLayer::indirect);
    const Image splatted = renderer.read();
    const std::vector<bool> other = other_surfaces(scene, renderer, cornell_camera());
    EXPECT_LT(difference(gathered, expected, other), 0.005);
    EXPECT_LT(difference(splatted, expected, other), 0.005);
    // The same weights, summed up in another order.
    EXPECT_LT(difference(splatted, gathered), 1e-4);
}

TEST_P(OnContext, DirectLightIsThatOfShadowRaysButForShadowEdges) {
    const TransferScene& scene = opened(cornell);
    auto dark = std::make_shared<DisplayField>(scene.file.transfer.points);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    for (const float angle : {20.0f, 50.0f, 75.0f, 120.0f, 180.0f}) {
        const Spotlight light = spot(angle);
        const Image expected = render_picture(scene.surface, scene.display, {}, light, cornell_camera(), Layer::direct, 1).image;
        renderer.set_light(light, dark);
        renderer.draw(cornell_camera(), ViewLayer::direct);
        std::vector<bool> left_out = shadow_edges(expected);
        const std::vector<bool> other = other_surfaces(scene, renderer, cornell_camera());
        std::transform(other.begin(), other.end(), left_out.begin(), left_out.begin(), std::logical_or<>());
        EXPECT_LT(difference(renderer.read(), expected, left_out), 0.02) << angle << " degrees";
    }
}

TEST_P(OnContext, DirectLightFollowsIntensityAndInnerAngleAlone) {
    // Neither needs another shadow map.
    const TransferScene& scene = opened(cornell);
    auto dark = std::make_shared<DisplayField>(scene.file.transfer.points);
    const auto drawn = [&](Renderer& renderer, const Spotlight& light) {
        renderer.set_light(light, dark);
        renderer.draw(cornell_camera(), ViewLayer::direct);
        return renderer.read();
    };
    Spotlight other = spot(50.0f);
    other.intensity *= Rgb(8.0f, 1.0f, 0.0f);
    other.inner_angle = 10.0f;
    Renderer renderer(context->gl(), scene, IndirectMethod::gather), fresh(context->gl(), scene, IndirectMethod::gather);
    drawn(renderer, spot(50.0f));
    EXPECT_EQ(drawn(renderer, other).rgb, drawn(fresh, other).rgb);
}

TEST_P(OnContext, FullLightIsDirectAndIndirect) {
    const TransferScene& scene = opened(cornell);
    LightSolver solver(scene, 0);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    renderer.set_light(spot(50.0f), solver.solve(spot(50.0f)));
    const auto layer = [&](ViewLayer which) {
        renderer.draw(cornell_camera(), which);
        return renderer.read();
    };
    const Image direct = layer(ViewLayer::direct), indirect = layer(ViewLayer::indirect);
    Image sum = direct;
    std::transform(sum.rgb.begin(), sum.rgb.end(), indirect.rgb.begin(), sum.rgb.begin(), std::plus<>());
    EXPECT_LT(difference(layer(ViewLayer::full), sum), 1e-5);
}

TEST_P(OnContext, PixelsShowWhatRaysHit) {
    const TransferScene& scene = opened(cornell);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    const Camera camera = cornell_camera();
    renderer.draw(camera, ViewLayer::reflectance);
    const Image reflectance = renderer.read();
    const PixelSurfaces& pixels = renderer.pixels();
    const std::vector<bool> other = other_surfaces(scene, renderer, camera);
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const auto p = static_cast<std::size_t>(y * camera.width + x);
            if (other[p] || pixels.surface[p] == no_index) continue;
            const Hit hit = scene.surface.closest_hit(
                {camera.position, camera.direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)});
            const SurfacePoint expected = scene.surface.point(hit), found = pixels.point(p);
            EXPECT_LT((expected.position - found.position).norm(), 1e-5f);
            EXPECT_LT((expected.normal - found.normal).norm(), 1e-3f);
            EXPECT_EQ(pixels.surface[p] % 2, hit.back_side ? 1u : 0u);
            EXPECT_LT((reflectance.pixel(x, y) - scene.surface.reflectance(hit)).abs().maxCoeff(), 1e-3f); // half floats
        }
}

/// A room of 4 m with waves in the normals of its floor and a bumpy wall, as an OBJ file.
std::string bumpy_room() {
    static const TemporaryFolder folder;
    std::vector<unsigned char> waves, bumps;
    for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x) {
            const double angle = 0.6 * std::sin(x * 0.4);
            for (const double c : {std::sin(angle), 0.0, std::cos(angle)})
                waves.push_back(static_cast<unsigned char>(std::lround(128.0 + 127.0 * c)));
            for (int c = 0; c < 3; ++c) bumps.push_back(static_cast<unsigned char>(128 + 100 * std::sin(x * 0.8) * std::cos(y * 0.8)));
        }
    write_png_bytes(folder.path("waves.png"), 32, 32, waves);
    write_png_bytes(folder.path("bumps.png"), 32, 32, bumps);
    folder.write("room.mtl", "newmtl floor\nKd 0.6 0.5 0.4\nnorm waves.png\n"
                             "newmtl wall\nKd 0.5 0.5 0.6\nmap_Bump -bm 2 bumps.png\nnewmtl plain\nKd 0.6 0.6 0.6\n");
    return folder.write("room.obj",
        "mtllib room.mtl\nv 0 0 0\nv 4 0 0\nv 4 0 4\nv 0 0 4\nv 0 3 0\nv 4 3 0\nv 4 3 4\nv 0 3 4\n"
        "vt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\nusemtl floor\nf 1/1 4/4 3/3 2/2\nusemtl wall\nf 1/1 2/2 6/3 5/4\n"
        "usemtl plain\nf 5 6 7 8\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
}

TEST_P(OnContext, NormalMapsAreThoseOfTheRendererOnTheCpu) {
    const std::string room = bumpy_room();
    const TransferScene& scene = opened(room);
    ASSERT_EQ(scene.scene.normal_maps.size(), 2u);
    const Camera camera{.position = {3.5f, 2.0f, 3.5f}, .target = {1.5f, 0.5f, 0.5f}, .vertical_fov = 60.0f, .width = 240, .height = 180};
    Spotlight light{.position = {2.0f, 2.5f, 2.5f}, .direction = {-0.2f, -1.0f, -0.5f}, .inner_angle = 30.0f, .outer_angle = 50.0f};
    light.check();
    const VectorIrradiance field = scene.transport.indirect(light);
    auto lit = std::make_shared<DisplayField>(scene.file.transfer.points);
    lit->set(field);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    renderer.set_light(light, lit);
    const auto expected = [&](Layer layer) {
        return render_picture(scene.surface, scene.display, field, light, camera, layer, 1).image;
    };
    const auto drawn = [&](ViewLayer layer) {
        renderer.draw(camera, layer);
        return renderer.read();
    };
    const Image gathered = drawn(ViewLayer::indirect), direct = drawn(ViewLayer::direct);
    const std::vector<bool> other = other_surfaces(scene, renderer, camera);
    EXPECT_LT(difference(gathered, expected(Layer::indirect), other), 0.005);
    EXPECT_LT(difference(direct, expected(Layer::direct), other), 0.02);
    renderer.set_method(IndirectMethod::splat);
    EXPECT_LT(difference(drawn(ViewLayer::indirect), gathered), 1e-4);
    // The maps are seen: without them the picture is another one.
    Scene flat = scene.scene;
    for (Material& material : flat.materials) material.normal_map = no_index;
    const Surface flat_surface(flat);
    const Display flat_display(scene.file.transfer, flat_surface);
    EXPECT_GT(difference(gathered, render_picture(flat_surface, flat_display, field, light, camera, Layer::indirect, 1).image), 0.05);
}

TEST_P(OnContext, TexturesLargerThanOpenGlTakesAreShownSmaller) {
    static const TemporaryFolder folder;
    GLint most = 0;
    context->gl().GetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
    const int width = most + most / 4;
    std::vector<unsigned char> halves; // red on the left, green on the right
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < width; ++x)
            for (int c = 0; c < 3; ++c) halves.push_back(c == (2 * x < width ? 0 : 1) ? 200 : 0);
    write_png_bytes(folder.path("halves.png"), width, 2, halves);
    folder.write("room.mtl", "newmtl floor\nmap_Kd halves.png\nnewmtl plain\nKd 0.6 0.6 0.6\n");
    const std::string room = folder.write("room.obj",
        "mtllib room.mtl\nv 0 0 0\nv 4 0 0\nv 4 0 4\nv 0 0 4\nv 0 3 0\nv 4 3 0\nv 4 3 4\nv 0 3 4\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl floor\nf 1/1 4/4 3/3 2/2\n"
        "usemtl plain\nf 1 2 6 5\nf 5 6 7 8\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    const TransferScene& scene = opened(room);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    const Camera down{.position = {2.0f, 2.9f, 2.0f}, .target = {2.0f, 0.0f, 2.0f}, .up = {0.0f, 0.0f, 1.0f},
                      .vertical_fov = 50.0f, .width = 60, .height = 60};
    renderer.draw(down, ViewLayer::reflectance);
    const Image seen = renderer.read();
    for (int y = 0; y < seen.height; ++y)
        for (int x = 0; x < seen.width; ++x) {
            if (std::abs(x - seen.width / 2) < 2) continue;
            const Hit hit = scene.surface.closest_hit(
                {down.position, down.direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f)});
            EXPECT_LT((seen.pixel(x, y) - scene.surface.reflectance(hit)).abs().maxCoeff(), 1e-3f) << x << " " << y;
        }
}

TEST_P(OnContext, APictureGetsBetterWhileItIsDrawnAgain) {
    const TransferScene& scene = opened(cornell);
    LightSolver solver(scene, 0);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    renderer.set_light(spot(50.0f), solver.solve(spot(50.0f)));
    renderer.draw(cornell_camera(), ViewLayer::indirect);
    const Image whole = renderer.read();
    Renderer hasty(context->gl(), scene, IndirectMethod::gather);
    hasty.set_light(spot(50.0f), solver.solve(spot(50.0f)));
    hasty.draw(cornell_camera(), ViewLayer::indirect, 100);
    EXPECT_GT(hasty.patches_missing(), 0u);
    EXPECT_LT(difference(hasty.read(), whole), 0.3);
    for (int k = 0; k < 1000 && hasty.patches_missing() > 0; ++k)
        hasty.draw(cornell_camera(), ViewLayer::indirect, 500);
    EXPECT_EQ(hasty.patches_missing(), 0u);
    EXPECT_LT(difference(hasty.read(), whole), 0.005);
}

TEST_P(OnContext, OddLightsAndCamerasGiveSanePictures) {
    const TransferScene& scene = opened(cornell);
    LightSolver solver(scene, 0);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    std::vector<Spotlight> lights(4, spot(50.0f));
    lights[0].position = {0.278f, 0.0f, 0.28f};  // in the floor
    lights[1].position = {0.37f, 0.2f, 0.35f};   // within the tall block
    lights[2].position = {0.278f, 0.3f, 50.0f};  // far behind the wall
    lights[3].intensity.setZero();
    std::vector<Camera> cameras(4, cornell_camera());
    cameras[1].position = {0.37f, 0.2f, 0.35f};
    cameras[2].target = {0.25f, 0.3f, -10.0f};   // away from all
    cameras[3].width = cameras[3].height = 1;
    for (const Spotlight& light : lights) {
        renderer.set_light(light, solver.solve(light));
        for (const Camera& camera : cameras) {
            renderer.draw(camera, ViewLayer::full);
            const Image picture = renderer.read();
            EXPECT_TRUE(std::all_of(picture.rgb.begin(), picture.rgb.end(),
                                    [](float v) { return std::isfinite(v) && v >= 0.0f && v < 1e4f; }));
        }
    }
}

TEST_P(OnContext, ShowsThePictureAsAPngFileHasIt) {
    const TransferScene& scene = opened(cornell);
    auto dark = std::make_shared<DisplayField>(scene.file.transfer.points);
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    renderer.set_light(spot(50.0f), dark);
    const Camera camera = cornell_camera();
    renderer.draw(camera, ViewLayer::direct);
    const Image picture = renderer.read();
    const ToneMap tone_map(picture, 0.18f);
    const Gl& gl = context->gl();
    const GlName target = make_texture(gl, byte4_texels, camera.width, camera.height);
    const GlName framebuffer = make_framebuffer(gl, {target});
    renderer.composition().show(framebuffer, 0, 0, camera.width, camera.height, true, tone_map, 1.0f);
    std::vector<unsigned char> bytes(4 * picture.rgb.size() / 3);
    gl.ReadPixels(0, 0, camera.width, camera.height, GL_RGBA, GL_UNSIGNED_BYTE, bytes.data());
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const Rgb mapped = tone_map(picture.pixel(x, y)).min(1.0f);
            for (int c = 0; c < 3; ++c) {
                const float s = mapped[c] <= 0.0031308f ? 12.92f * mapped[c] : 1.055f * std::pow(mapped[c], 1.0f / 2.4f) - 0.055f;
                const auto row = static_cast<std::size_t>(camera.height - 1 - y); // the bottom comes first
                const int shown = bytes[4 * (row * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x)) + static_cast<std::size_t>(c)];
                ASSERT_NEAR(shown, 255.0f * s, 1.01f) << x << ", " << y;
            }
        }
}

TEST(GlProgram, ABrokenShaderIsAnError) {
    const auto context = make_offscreen_context("auto");
    EXPECT_THROW(GlProgram(context->gl(), "broken", whole_picture_vertex_shader, "void main() { nonsense }", {}, {}), Error);
    EXPECT_FALSE(context->gl().errors().empty()); // the driver's own report
}

TEST(GlContext, AnUnknownNameIsAWrongUse) { EXPECT_THROW(make_offscreen_context("glx"), UsageError); }

// A scene that is not part of this project, where it is there.
TEST(Renderer, SponzaFromSplatGatherAndCpuIsOnePicture) {
    const std::string sponza = "../shared/scenes/sponza/sponza.obj";
    const std::filesystem::path root = std::filesystem::path(AFTERGLOW_TESTS).parent_path();
    if (!std::filesystem::exists(root / sponza)) GTEST_SKIP() << "no " << sponza;
    const std::string path = (root / sponza).string();
    const TransferScene& scene = opened(path);
    const auto context = make_offscreen_context("egl");
    Spotlight light{.position = {0.0f, 9.0f, 0.0f}, .direction = {-0.2f, -1.0f, 0.1f}, .inner_angle = 32.0f, .outer_angle = 40.0f};
    light.check();
    const Camera camera{.position = {-10.0f, 2.0f, 0.0f}, .target = {-9.0f, 2.15f, 0.0f}, .vertical_fov = 46.0f, .width = 480, .height = 270};
    const VectorIrradiance field = scene.transport.indirect(light);
    auto lit = std::make_shared<DisplayField>(scene.file.transfer.points);
    lit->set(field);
    const auto cpu = [&](int gap_paths) {
        return render_picture(scene.surface, scene.display, field, light, camera, Layer::indirect, 4, gap_paths).image;
    };
    const Image direct = render_picture(scene.surface, scene.display, field, light, camera, Layer::direct, 1).image;
    Renderer renderer(context->gl(), scene, IndirectMethod::gather);
    renderer.set_light(light, lit);
    const Image gathered = renderer.average(camera, ViewLayer::indirect, 4);
    renderer.set_method(IndirectMethod::splat);
    const Image splatted = renderer.average(camera, ViewLayer::indirect, 4);
    // (Looking again, patches are told apart more finely.)
    EXPECT_LT(difference(splatted, gathered), 0.005);
    // Single samples beside edges show the surface behind: one in 4000, with other light.
    EXPECT_LT(difference(gathered, cpu(0)), 0.01);
    // In gaps, a half per cent of the pixels, functions alone say something else.
    EXPECT_LT(difference(gathered, cpu(256)), 0.02);
    renderer.draw(camera, ViewLayer::direct);
    EXPECT_LT(difference(renderer.read(), direct, shadow_edges(direct)), 0.02);
}

} // namespace
} // namespace afterglow
