#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/scene.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <functional>
#include <set>

namespace afterglow {
namespace {

/// Four texels: black, red / green, blue, the first row at the bottom.
Texture four_colours() {
    return {2, 2, {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

void expect_colour(const Rgb& found, const Rgb& expected) {
    EXPECT_LT((found - expected).abs().maxCoeff(), 1e-6f) << found.transpose();
}

TEST(Texture, ShowsEachTexelAtItsCentre) {
    const Texture texture = four_colours();
    expect_colour(texture.sample({0.25f, 0.25f}), {0, 0, 0});
    expect_colour(texture.sample({0.75f, 0.25f}), {1, 0, 0});
    expect_colour(texture.sample({0.25f, 0.75f}), {0, 1, 0});
    expect_colour(texture.sample({0.75f, 0.75f}), {0, 0, 1});
}

TEST(Texture, BlendsBetweenTexels) {
    const Texture texture = four_colours();
    expect_colour(texture.sample({0.5f, 0.25f}), {0.5f, 0, 0});
    expect_colour(texture.sample({0.5f, 0.5f}), {0.25f, 0.25f, 0.25f});
}

TEST(Texture, RepeatsInBothDirections) {
    const Texture texture = four_colours();
    for (const float u : {-2.75f, -0.75f, 0.25f, 3.25f})
        for (const float v : {-0.25f, 0.75f, 1.75f})
            expect_colour(texture.sample({u, v}), {0, 1, 0});
    expect_colour(texture.sample({0.0f, 0.25f}), {0.5f, 0, 0}); // across the seam
}

TEST(Texture, StaysInsideAtExtremeCoordinates) {
    const Texture texture = four_colours();
    for (const float u : {0.0f, -0.0f, 1.0f, 0x1.fffffep-1f, -1e-10f, 1e30f, -1e30f, 16777217.0f}) {
        const Rgb c = texture.sample({u, -u});
        EXPECT_TRUE((c >= 0.0f).all() && (c <= 1.0f).all()) << u;
    }
    expect_colour((Texture{1, 1, {0.1f, 0.2f, 0.3f}}).sample({0.9f, 0.1f}), {0.1f, 0.2f, 0.3f});
}

TEST(SceneSummary, IsOneLineOfWhatIsNotZero) {
    SceneSummary summary;
    summary.faces = 6;
    summary.triangles = 12;
    EXPECT_EQ(summary.line(), "6 faces, 12 triangles");
    summary.dropped_degenerate = 3;
    summary.dropped_not_finite = 1;
    summary.clamped_reflectance = 2;
    summary.missing_files = {"a.mtl", "b.png"};
    EXPECT_EQ(summary.line(),
              "6 faces, 12 triangles; dropped: 3 of zero area, 1 not finite; 2 reflectances "
              "clamped; cannot read a.mtl, b.png");
}

Scene textured_scene() {
    Scene scene = make_builtin_scene("builtin:furnace");
    scene.normals = {Vec3::UnitX()};
    scene.normal_indices.assign(scene.triangles.size(), {0, 0, 0});
    scene.texture_coordinates = {{0, 0}, {1, 0}, {0, 1}};
    scene.texture_indices.assign(scene.triangles.size(), {0, 1, 2});
    scene.textures = {four_colours()};
    scene.materials[0].texture = 0;
    return scene;
}

TEST(ContentHash, ChangesWithAllThatLightSees) {
    const std::vector<std::function<void(Scene&)>> changes = {
        [](Scene&) {},
        [](Scene& s) { s.positions[0].x() += 1e-6f; },
        [](Scene& s) { std::swap(s.triangles[0][1], s.triangles[0][2]); },
        [](Scene& s) { s.normals[0] = Vec3::UnitY(); },
        [](Scene& s) { s.normal_indices[3][0] = no_index; },
        [](Scene& s) { s.texture_coordinates[2].y() = 2; },
        [](Scene& s) {
            s.texture_indices[0] = {2, 1, 0};
        },
        [](Scene& s) {
            s.materials.push_back({"new", Rgb::Constant(0.5f), no_index});
        },
        [](Scene& s) { s.materials[0].reflectance[1] = 0.25f; },
        [](Scene& s) { s.materials[0].texture = no_index; },
        [](Scene& s) { s.textures[0].rgb[0] = 0.5f; },
        [](Scene& s) { s.textures[0].width = 1, s.textures[0].height = 4; },
        [](Scene& s) { s.material_index[0] = 1; },
    };
    std::set<std::string> hashes;
    for (const auto& change : changes) {
        Scene scene = textured_scene();
        change(scene);
        hashes.insert(scene.content_hash());
        EXPECT_EQ(scene.content_hash().size(), 32u);
    }
    EXPECT_EQ(hashes.size(), changes.size());
}

TEST(ContentHash, IgnoresNamesAndViewpoint) {
    Scene scene = textured_scene();
    const std::string before = scene.content_hash();
    scene.name = "elsewhere.obj";
    scene.materials[0].name = "other";
    scene.viewpoint.reset();
    scene.summary.faces = 99;
    EXPECT_EQ(scene.content_hash(), before);
}

TEST(Bounds, HoldAllVertices) {
    const Eigen::AlignedBox3f box = make_builtin_scene("builtin:furnace").bounds();
    EXPECT_EQ(box.min(), Vec3(-1, -1, -1));
    EXPECT_EQ(box.max(), Vec3(1, 1, 1));
    EXPECT_TRUE(Scene().bounds().isEmpty());
}

TEST(LoadScene, TellsFilesFromBuiltinNames) {
    EXPECT_EQ(load_scene("builtin:furnace").triangles.size(), 12u);
    EXPECT_THROW(load_scene("builtin:"), UsageError);
    EXPECT_THROW(load_scene("no such file.obj"), FileError);
}

} // namespace
} // namespace afterglow
