#include "core/normal_map.h"

#include "core/obj_loader.h"
#include "core/surface.h"
#include "tests/support/temporary_folder.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <stb_image_write.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

namespace afterglow {
namespace {

using Bytes = std::vector<unsigned char>; // R, G, B a texel, rows from the top

// Bytes have steps of 1/127.
constexpr float byte_step = 1.0f / 127.0f;

Bytes coded(const Vec3& n) {
    Bytes bytes;
    for (const float c : n) bytes.push_back(static_cast<unsigned char>(std::lround(128.0f + 127.0f * c)));
    return bytes;
}

Bytes repeated(const Bytes& texel, int count) {
    Bytes all;
    for (int i = 0; i < count; ++i) all.insert(all.end(), texel.begin(), texel.end());
    return all;
}

/// A height of 0 to 255 in each texel, the same in all rows.
Bytes heights(const std::vector<int>& row, int rows) {
    Bytes all;
    for (int y = 0; y < rows; ++y)
        for (const int h : row) all.insert(all.end(), 3, static_cast<unsigned char>(h));
    return all;
}

struct Picture {
    int width, height;
    Bytes bytes;
};

/// The square [0, 1]^2 at z = 0, front towards +z, with (u, v) = (x, y) turned by `turn`, under a
/// material of the given lines, which may name the picture "map.png".
Scene square(const std::string& lines, const Picture& map,
             const Eigen::Matrix2f& turn = Eigen::Matrix2f::Identity(), const std::string& normals = "") {
    const TemporaryFolder folder;
    EXPECT_TRUE(stbi_write_png(folder.path("map.png").c_str(), map.width, map.height, 3, map.bytes.data(), 3 * map.width));
    folder.write("a.mtl", "newmtl m\nKd 0.5 0.5 0.5\n" + lines);
    std::string text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + normals;
    for (const Vec2& corner : {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1), Vec2(0, 1)}) {
        const Vec2 uv = turn * corner;
        text += "vt " + std::to_string(uv.x()) + " " + std::to_string(uv.y()) + "\n";
    }
    text += normals.empty() ? "usemtl m\nf 1/1 2/2 3/3 4/4\n" : "usemtl m\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";
    return load_obj(folder.write("a.obj", text));
}

Vec3 shown_at(const Scene& scene, const Vec2& at, bool from_behind = false) {
    const Surface surface(scene);
    const float side = from_behind ? -1.0f : 1.0f;
    const Hit hit = surface.closest_hit({{at.x(), at.y(), side}, -side * Vec3::UnitZ()});
    EXPECT_TRUE(hit);
    return surface.shown_normal(hit, surface.point(hit));
}

Eigen::Matrix2f matrix(float a, float b, float c, float d) {
    Eigen::Matrix2f m;
    m << a, b, c, d;
    return m;
}

const Vec3 tilted = Vec3(0.48f, -0.36f, 0.8f);

TEST(NormalMap, IsReadInTheFrameOfTheTextureCoordinates) {
    const Picture map{2, 2, repeated(coded(tilted), 4)};
    for (const std::string line : {"norm map.png\n", "bump map.png\n", "map_Bump map.png\n", "map_bump map.png\n"}) {
        EXPECT_LT((shown_at(square(line, map), {0.3f, 0.6f}) - tilted).norm(), 2.0f * byte_step) << line;
        EXPECT_LT((shown_at(square(line, map), {0.6f, 0.3f}) - tilted).norm(), 2.0f * byte_step) << line;
    }
    // u along y and v along -x; mirrored: v along -y; stretched and sheared: still u's own direction.
    const Vec3 turned = shown_at(square("norm map.png\n", map, matrix(0, 1, -1, 0)), {0.3f, 0.6f});
    EXPECT_LT((turned - Vec3(0.36f, 0.48f, 0.8f)).norm(), 2.0f * byte_step);
    const Vec3 mirrored = shown_at(square("norm map.png\n", map, matrix(1, 0, 0, -1)), {0.3f, 0.6f});
    EXPECT_LT((mirrored - Vec3(0.48f, 0.36f, 0.8f)).norm(), 2.0f * byte_step);
    const Vec3 sheared = shown_at(square("norm map.png\n", map, matrix(5, 0, 2, 3)), {0.3f, 0.6f});
    // u = 5 x rises fastest along x, but where v = 2 x + 3 y stays: along (3, -2).
    const Vec3 u = Vec3(3, -2, 0).normalized(), v = Vec3(2, 3, 0).normalized();
    EXPECT_LT((sheared - (0.48f * u - 0.36f * v + 0.8f * Vec3::UnitZ())).norm(), 2.0f * byte_step);
}

TEST(NormalMap, HasItsFirstRowOnTop) {
    Bytes bytes = repeated(coded(Vec3::UnitZ()), 2);
    const Bytes below = repeated(coded(tilted), 2);
    bytes.insert(bytes.end(), below.begin(), below.end());
    const Scene scene = square("norm map.png\n", {2, 2, bytes});
    EXPECT_LT((shown_at(scene, {0.3f, 0.25f}) - tilted).norm(), 2.0f * byte_step);
    EXPECT_LT((shown_at(scene, {0.3f, 0.75f}) - Vec3::UnitZ()).norm(), 1e-5f);
}

TEST(NormalMap, SeenFromBehindIsTheSameSurface) {
    const Scene scene = square("norm map.png\n", {1, 1, coded(tilted)});
    EXPECT_LT((shown_at(scene, {0.3f, 0.6f}, true) + shown_at(scene, {0.3f, 0.6f})).norm(), 1e-5f);
}

TEST(NormalMap, BendsTheInterpolatedNormal) {
    // The normal leans by 0.6 towards y, the map from there by 0.6 towards u.
    const Scene scene = square("norm map.png\n", {1, 1, coded(Vec3(0.6f, 0.0f, 0.8f))},
                               Eigen::Matrix2f::Identity(), "vn 0 0.6 0.8\n");
    const Vec3 expected = 0.6f * Vec3::UnitX() + 0.8f * Vec3(0.0f, 0.6f, 0.8f);
    EXPECT_LT((shown_at(scene, {0.3f, 0.6f}) - expected).norm(), 2.0f * byte_step);
}

TEST(NormalMap, NeverPointsIntoTheSurface) {
    for (const Vec3& inward : {Vec3(0.6f, 0.0f, -0.8f), Vec3(0.0f, 0.0f, -1.0f), Vec3(1.0f, 0.0f, 0.0f)}) {
        const Scene scene = square("norm map.png\n", {1, 1, coded(inward)});
        for (const bool from_behind : {false, true}) {
            const Vec3 n = shown_at(scene, {0.3f, 0.6f}, from_behind);
            EXPECT_NEAR(n.norm(), 1.0f, 1e-5f);
            EXPECT_GE(n.z() * (from_behind ? -1.0f : 1.0f), 0.0099f) << inward.transpose();
        }
    }
}

TEST(NormalMap, IsNothingWhereTextureCoordinatesSayNothing) {
    const Picture map{1, 1, coded(tilted)};
    // All one point; all on one line.
    for (const Eigen::Matrix2f& turn : {matrix(0, 0, 0, 0), matrix(1, 2, 2, 4)})
        EXPECT_EQ(shown_at(square("norm map.png\n", map, turn), {0.3f, 0.6f}), Vec3(Vec3::UnitZ()));
    Scene scene = square("norm map.png\n", map);
    scene.texture_indices.assign(2, {no_index, no_index, no_index});
    EXPECT_EQ(shown_at(scene, {0.3f, 0.6f}), Vec3(Vec3::UnitZ()));
    scene.texture_indices.clear();
    EXPECT_EQ(shown_at(scene, {0.3f, 0.6f}), Vec3(Vec3::UnitZ()));
    EXPECT_EQ(shown_at(square("", map), {0.3f, 0.6f}), Vec3(Vec3::UnitZ()));
}

TEST(NormalMap, OfHeightsLeansAwayFromWhereTheyRise) {
    // A ramp of 51 a texel along u: in its middle, a slope of 1/5 times -bm.
    const Picture ramp{6, 4, heights({0, 51, 102, 153, 204, 255}, 4)};
    for (const float multiplier : {1.0f, 2.5f, -1.0f}) {
        const Scene scene = square("bump -bm " + std::to_string(multiplier) + " map.png\n", ramp);
        const Vec3 expected = Vec3(-0.2f * multiplier, 0.0f, 1.0f).normalized();
        EXPECT_LT((shown_at(scene, {0.5f, 0.6f}) - expected).norm(), 1e-5f) << multiplier;
    }
    EXPECT_EQ(shown_at(square("map_Bump map.png\n", {4, 4, heights({90, 90, 90, 90}, 4)}), {0.5f, 0.6f}), Vec3(Vec3::UnitZ()));
}

TEST(NormalMap, AGreyPictureIsNotTakenForNormals) {
    // 0.79 on each channel is of unit length, read as a direction.
    for (const int grey : {0, 128, 201, 255}) {
        const Scene scene = square("bump map.png\n", {2, 2, heights({grey, grey}, 2)});
        EXPECT_EQ(shown_at(scene, {0.3f, 0.6f}), Vec3(Vec3::UnitZ())) << grey;
    }
}

TEST(NormalMap, FlatOneChangesNothing) {
    const Scene scene = square("norm map.png\n", {2, 2, repeated({128, 128, 255}, 4)}, matrix(0.3f, 0.9f, 0.2f, -0.7f), "vn 0 0.6 0.8\n");
    const Surface surface(scene);
    const Hit hit = surface.closest_hit({{0.3f, 0.6f, 1.0f}, -Vec3::UnitZ()});
    const SurfacePoint x = surface.point(hit);
    EXPECT_LT((surface.shown_normal(hit, x) - x.normal).norm(), 1e-6f);
}

TEST(NormalMap, IsReadOnceForAllMaterialsThatNameIt) {
    const TemporaryFolder folder;
    const Bytes map = coded(tilted);
    ASSERT_TRUE(stbi_write_png(folder.path("map.png").c_str(), 1, 1, 3, map.data(), 3));
    folder.write("a.mtl", "newmtl a\nnorm map.png\nnewmtl b\nbump other.png\nnorm map.png\nnewmtl c\nnorm none.png\n");
    const Scene scene = load_obj(folder.write(
        "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n"));
    EXPECT_EQ(scene.normal_maps.size(), 1u);
    EXPECT_EQ(scene.materials[0].normal_map, 0u);
    EXPECT_EQ(scene.materials[1].normal_map, 0u); // norm goes before bump
    EXPECT_EQ(scene.materials[2].normal_map, no_index);
    EXPECT_EQ(scene.summary.missing_files, std::vector<std::string>{folder.path("none.png")});
}

TEST(NormalMap, IsNoPartOfTheContentHash) {
    const Picture map{1, 1, coded(tilted)};
    EXPECT_EQ(square("norm map.png\n", map).content_hash(), square("", map).content_hash());
}

} // namespace
} // namespace afterglow
