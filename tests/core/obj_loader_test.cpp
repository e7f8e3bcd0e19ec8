#include "core/error.h"
#include "core/obj_loader.h"
#include "core/sampling.h"
#include "core/surface.h"
#include "tests/support/temporary_folder.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <stb_image_write.h>

#include <clocale>

namespace afterglow {
namespace {

const std::string square_corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

Scene load_text(const std::string& obj) {
    const TemporaryFolder folder;
    return load_obj(folder.write("scene.obj", obj));
}

/// What every loaded scene promises, however broken its file was.
void expect_sound(const Scene& scene) {
    ASSERT_FALSE(scene.triangles.empty());
    ASSERT_EQ(scene.material_index.size(), scene.triangles.size());
    for (const Triangle& t : scene.triangles)
        for (const std::uint32_t i : t)
            ASSERT_LT(i, scene.positions.size());
    for (const Vec3& p : scene.positions)
        ASSERT_TRUE(p.allFinite());
    for (const Vec3& n : scene.normals)
        ASSERT_NEAR(n.norm(), 1.0f, 1e-5f);
    for (const Vec2& uv : scene.texture_coordinates)
        ASSERT_TRUE(uv.allFinite());
    const auto expect_indices = [&](const std::vector<Triangle>& indices, std::size_t size) {
        if (indices.empty()) return;
        ASSERT_EQ(indices.size(), scene.triangles.size());
        for (const Triangle& t : indices) {
            const bool none = t[0] == no_index && t[1] == no_index && t[2] == no_index;
            ASSERT_TRUE(none || (t[0] < size && t[1] < size && t[2] < size));
        }
    };
    expect_indices(scene.normal_indices, scene.normals.size());
    expect_indices(scene.texture_indices, scene.texture_coordinates.size());
    for (const std::uint32_t m : scene.material_index)
        ASSERT_LT(m, scene.materials.size());
    for (const Material& m : scene.materials) {
        ASSERT_TRUE((m.reflectance >= 0.0f).all() && (m.reflectance < 1.0f).all());
        ASSERT_TRUE(m.texture == no_index || m.texture < scene.textures.size());
        ASSERT_TRUE(m.normal_map == no_index || m.normal_map < scene.normal_maps.size());
    }
    EXPECT_EQ(scene.summary.triangles, scene.triangles.size());
}

TEST(ObjLoader, ReadsTrianglesInTheirOrderAndWinding) {
    const Scene scene = load_text(square_corners + "f 1 2 3\nf 1 3 4\n");
    expect_sound(scene);
    EXPECT_EQ(scene.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(scene.positions[2], Vec3(1, 1, 0));
    EXPECT_TRUE(scene.normals.empty());
    EXPECT_TRUE((scene.materials[0].reflectance == 0.5f).all()); // grey where nothing is said
    EXPECT_EQ(scene.summary.line(), "2 faces, 2 triangles; 2 triangles in default grey");
}

TEST(ObjLoader, CutsConcavePolygonsInsideTheirOutline) {
    // An L of area 5 and a dart; a fan from the first corner would cover other ground.
    const Scene scene = load_text("v 1 3 0\nv 0 3 0\nv 0 0 0\nv 3 0 0\nv 3 1 0\nv 1 1 0\n"
                                  "f 1 2 3 4 5 6\n");
    expect_sound(scene);
    double area = 0.0;
    for (const Triangle& t : scene.triangles) {
        const Vec3 n = (scene.positions[t[1]] - scene.positions[t[0]])
                           .cross(scene.positions[t[2]] - scene.positions[t[0]]);
        EXPECT_GT(n.z(), 0.0f);
        area += 0.5 * n.norm();
    }
    EXPECT_NEAR(area, 5.0, 1e-5);
    const Surface surface(scene);
    EXPECT_FALSE(surface.closest_hit({{2, 2, 1}, -Vec3::UnitZ()}));
}

TEST(ObjLoader, CountsNegativeIndicesFromTheLastVertex) {
    const Scene scene = load_text(square_corners + "f -4 -3 -2\nv 5 5 5\nf -5 -3 -2\n");
    expect_sound(scene);
    EXPECT_EQ(scene.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
    EXPECT_EQ(scene.positions.size(), 4u); // the stray vertex is left out
}

TEST(ObjLoader, AllowsFacesBeforeTheirVertices) {
    const Scene scene = load_text("f 1 2 3\n" + square_corners);
    expect_sound(scene);
    EXPECT_EQ(scene.triangles.size(), 1u);
}

TEST(ObjLoader, DropsFacesWithIndicesOutsideTheirList) {
    const Scene scene = load_text(square_corners
                                  + "f 1 2 3\nf 1 2 5\nf 0 1 2\nf -5 1 2\nf 1 2 2147483647\n"
                                    "f 1 2 -2147483648\nf 1 2 99999999999999999999\nf 1 2 x\n"
                                    "f 1 2 3 4 9\nf / // ///\nf\nf 1\nf 1 2\n");
    expect_sound(scene);
    EXPECT_EQ(scene.triangles.size(), 1u);
    // Seven triangles, a pentagon that would have given three, and slashes read as four corners.
    EXPECT_EQ(scene.summary.dropped_bad_index, 7u + 3u + 2u);
    EXPECT_EQ(scene.summary.dropped_degenerate, 2u); // the faces of one and of two corners
}

TEST(ObjLoader, DropsTrianglesWithCoordinatesThatAreNotFinite) {
    for (const char* odd : {"nan", "NaN", "-nan", "inf", "-inf", "infinity", "1e999", "-1e300",
                            "1.#IND", "1.#QNAN", "abc", "1e13"}) {
        const Scene scene = load_text(square_corners + "v 0 " + odd + " 0\nv 0 0 " + odd
                                      + "\nf 1 2 3\nf 1 2 5\nf 1 2 3 6\n");
        expect_sound(scene);
        EXPECT_EQ(scene.triangles.size(), 1u) << odd;
        EXPECT_EQ(scene.summary.dropped_not_finite, 3u) << odd;
    }
}

TEST(ObjLoader, DropsTrianglesOfZeroArea) {
    const Scene scene = load_text(square_corners
                                  + "v 2 0 0\nv 0 0 0\nv 0.5 1e-20 0\n"
                                    "f 1 2 3\nf 1 1 2\nf 1 2 5\nf 1 6 2\nf 1 7 2\nf 3 3 3\n");
    expect_sound(scene);
    EXPECT_EQ(scene.triangles.size(), 1u);
    EXPECT_EQ(scene.summary.dropped_degenerate, 5u);
}

TEST(ObjLoader, JudgesAreaByATrianglesOwnSize) {
    for (const char* size : {"1e-12", "1e-3", "1", "1e6", "1e12"}) {
        const std::string s = size;
        const Scene scene = load_text("v 0 0 0\nv " + s + " 0 0\nv 0 " + s + " 0\nf 1 2 3\n");
        EXPECT_EQ(scene.triangles.size(), 1u) << s;
        const Surface surface(scene);
        const float third = scene.positions[1].x() / 3.0f;
        const Hit hit =
            surface.closest_hit({{third, third, scene.positions[1].x()}, -Vec3::UnitZ()});
        ASSERT_TRUE(hit) << s;
        EXPECT_LT((surface.point(hit).normal - Vec3::UnitZ()).norm(), 1e-5f) << s;
    }
}

TEST(ObjLoader, NormalisesNormalsAndGivesUpUnusableOnes) {
    const Scene scene = load_text(square_corners
                                  + "vn 0 0 5\nvn 0 3 4\nvn 0 0 0\nvn nan 0 1\nvn 1e30 0 0\n"
                                    "f 1//1 2//2 3//5\n" // fine
                                    "f 1//1 2//3 3//1\n" // zero
                                    "f 1//1 2//4 3//4\n" // not a number, twice
                                    "f 1//1 2//9 3//1\n" // outside the list
                                    "f 1//1 2 3\n"       // none at two corners
                                    "f 1//-5 2//-4 3//-1\n");
    expect_sound(scene);
    EXPECT_EQ(scene.normal_indices[0], (Triangle{0, 1, 4}));
    for (const std::size_t i : {1u, 2u, 3u, 4u})
        EXPECT_EQ(scene.normal_indices[i][0], no_index);
    EXPECT_EQ(scene.normal_indices[5], (Triangle{0, 1, 4}));
    EXPECT_LT((scene.normals[1] - Vec3(0, 0.6f, 0.8f)).norm(), 1e-6f);
    EXPECT_LT((scene.normals[4] - Vec3::UnitX()).norm(), 1e-6f);
    EXPECT_EQ(scene.summary.replaced_normals, 4u);
}

TEST(ObjLoader, WindsTrianglesAsTheirNormalsSay) {
    // Mirrored, as by a negative scale: the normals are right, the winding is not.
    const Scene scene = load_text(square_corners
                                  + "vn 0.6 0 0.8\nvn -0.6 0 0.8\nvn 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\n"
                                    "f 1/1/1 3/3/3 2/2/2\n"
                                    "f 1/1/1 2/2/2 3/3/3\n"
                                    "f 1 4 3\n");
    expect_sound(scene);
    for (const std::size_t i : {0u, 1u}) {
        EXPECT_EQ(scene.triangles[i], (Triangle{0, 1, 2})) << i;
        EXPECT_EQ(scene.normal_indices[i], (Triangle{0, 1, 2})) << i;
        EXPECT_EQ(scene.texture_indices[i], (Triangle{0, 1, 2})) << i;
    }
    EXPECT_LT(scene.triangle_normal(2).z(), 0.0f); // no normals: as it is
    const Surface surface(scene);
    const Hit hit = surface.closest_hit({{0.3f, 0.1f, 1.0f}, -Vec3::UnitZ()});
    ASSERT_TRUE(hit);
    EXPECT_GT(std::abs(surface.point(hit).normal.x()), 0.1f) << "not flat";
}

TEST(ObjLoader, GivesUpUnusableTextureCoordinates) {
    const Scene scene = load_text(square_corners
                                  + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 3.4e38\n"
                                    "f 1/1 2/2 3/3\nf 1/1 2/2 3/4\nf 1/1 2/2 3/7\nf 1 2/2 3/3\n");
    expect_sound(scene);
    EXPECT_EQ(scene.texture_indices[0], (Triangle{0, 1, 2}));
    for (const std::size_t i : {1u, 2u, 3u})
        EXPECT_EQ(scene.texture_indices[i][0], no_index);
}

TEST(ObjLoader, ReadsAnyLineEndBlanksAndComments) {
    for (const std::string end : {"\n", "\r\n", "\r"}) {
        const Scene scene = load_text("# a comment" + end + "  v 0 0 0  " + end + "\tv 1 0 0 # here"
                                      + end + end + "v 0 1 0 1.0" + end + "v 1 1 0 0.5 0.5 0.5"
                                      + end + "s off" + end + "g" + end + "o" + end + "f 1 2 3\t"
                                      + end + "l 1 2" + end + "p 1" + end + "f 2 4 3");
        expect_sound(scene);
        EXPECT_EQ(scene.triangles.size(), 2u);
    }
}

TEST(ObjLoader, JoinsLinesThatEndInABackslash) {
    for (const std::string end : {"\n", "\r\n", "\r"}) {
        const std::string on = " \\" + end;
        const Scene scene = load_text("# C:\\scenes\\" + end + "v 0 0" + on + "0" + end + "v 1 0 0" + end + "v 1" + on + "1" + on
                                      + on + "0" + end + "f 1" + on + "2 3" + on);
        expect_sound(scene);
        EXPECT_EQ(scene.triangles, (std::vector<Triangle>{{0, 1, 2}}));
        EXPECT_EQ(scene.positions[2], Vec3(1, 1, 0));
        EXPECT_EQ(scene.summary.dropped_bad_index, 0u);
    }
}

TEST(ObjLoader, EndsFacesAtAComment) {
    const Scene scene = load_text(square_corners + "f 1 2 3 # the floor, 4 \nf 1 3 4# 2\nf 1 2 3 # 12345678901\n");
    expect_sound(scene);
    EXPECT_EQ(scene.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {0, 1, 2}}));
    EXPECT_EQ(scene.summary.dropped_bad_index, 0u);
}

TEST(ObjLoader, LeavesOutAByteOrderMark) {
    const TemporaryFolder folder;
    folder.write("a.mtl", "\xef\xbb\xbfnewmtl wall\nKd 0.2 0.4 0.6\n");
    const Scene scene = load_obj(folder.write("a.obj", "\xef\xbb\xbf" + square_corners + "mtllib a.mtl\nusemtl wall\nf 1 2 3\n"));
    EXPECT_EQ(scene.summary.line(), "1 faces, 1 triangles");
    EXPECT_EQ(scene.materials[0].name, "wall");
}

TEST(ObjLoader, ReadsNumbersInAnyLocale) {
    const std::string before = std::setlocale(LC_ALL, nullptr);
    for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"})
        if (std::setlocale(LC_ALL, name)) break;
    const Scene scene = load_text("v 0.5 0 0\nv 1.25 0 0\nv 0 1 0\nf 1 2 3\n");
    std::setlocale(LC_ALL, before.c_str());
    EXPECT_EQ(scene.positions[1].x(), 1.25f);
}

TEST(ObjLoader, RefusesFilesWithoutAUsableTriangle) {
    const TemporaryFolder folder;
    for (const std::string content :
         {"", "\n\n", "# nothing\n", "v 0 0 0\nv 1 0 0\n", "f 1 2 3\n",
          "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "\r", "v", "f", "f "})
        EXPECT_THROW(load_obj(folder.write("a.obj", content)), FileError) << content;
    EXPECT_THROW(load_obj(folder.path("none.obj")), FileError);
    EXPECT_THROW(load_obj(folder.path("")), FileError);
    EXPECT_THROW(load_obj("/dev/null"), FileError);
}

TEST(ObjLoader, RefusesBinaryGarbage) {
    const TemporaryFolder folder;
    Rng rng(1, 0);
    for (int round = 0; round < 20; ++round) {
        std::string garbage;
        for (int i = 0; i < 50'000; ++i)
            garbage += static_cast<char>(rng.next());
        EXPECT_THROW(load_obj(folder.write("a.obj", garbage)), FileError);
    }
}

TEST(ObjLoader, SurvivesRandomTextOfItsOwnWords) {
    // A generator of almost valid files: whatever comes out must be refused or sound.
    const char* const words[] = {"v ",
                                 "vn ",
                                 "vt ",
                                 "f ",
                                 "g ",
                                 "o ",
                                 "usemtl ",
                                 "mtllib ",
                                 "s ",
                                 "l ",
                                 "p ",
                                 "t ",
                                 "vw ",
                                 "\n",
                                 "\r",
                                 "#",
                                 "\\",
                                 "\xff",
                                 "1",
                                 "-1",
                                 "2",
                                 "-3",
                                 "0.5",
                                 "nan",
                                 "1e",
                                 "1e999",
                                 "/",
                                 "//",
                                 " ",
                                 "x.mtl",
                                 "\nf 1 2 3 ",
                                 "\nf -1 -2 -3 ",
                                 "\nf 1/1 2/2 3/1 ",
                                 "\nf 1//1 2//2 4//2 ",
                                 "\nf 4/2/1 3/1/1 2/1/2 ",
                                 "\nv 0 1 2 ",
                                 "\nv 3 1 7 ",
                                 "\nvt 3 1 ",
                                 "\nusemtl 1\n"};
    const TemporaryFolder folder;
    folder.write("x.mtl", "newmtl 1\nKd 0.2 0.4 0.6\nmap_Kd x.obj\nnorm x.obj\nnewmtl\nKd\nmap_Kd\nbump -bm\nnorm\n");
    int loaded = 0;
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
        Rng rng(seed, 1);
        std::string text = "mtllib x.mtl\n" + square_corners + "vt 0 0\nvt 1 0\nvn 0 0 1\nvn 1 0 0\n";
        for (int i = 0; i < 400; ++i)
            text += words[rng.next() % std::size(words)];
        try {
            expect_sound(load_obj(folder.write("x.obj", text)));
            ++loaded;
        } catch (const FileError&) { // nothing usable came out
        }
    }
    EXPECT_GT(loaded, 250);
}

// ---- Materials
// --------------------------------------------------------------------------------------

void write_picture(const std::string& path) {
    // The top row is black and white, the bottom row sRGB 188 (linear 0.503) and red.
    const unsigned char texels[] = {0, 0, 0, 255, 255, 255, 188, 188, 188, 255, 0, 0};
    ASSERT_TRUE(stbi_write_png(path.c_str(), 2, 2, 3, texels, 6));
}

const std::string textured_square =
    square_corners + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wall\nf 1/1 2/2 3/3 4/4\n";

TEST(ObjMaterials, AreTakenLinearFromTheMtlFile) {
    const TemporaryFolder folder;
    folder.write("a.mtl",
                 "newmtl unused\nKd 0 0 0\nmap_Kd none.png\nnewmtl wall\nKd 0.2 0.4 0.6\n");
    const Scene scene =
        load_obj(folder.write("a.obj", "mtllib a.mtl\n" + square_corners + "usemtl wall\nf 1 2 3\n"));
    expect_sound(scene);
    ASSERT_EQ(scene.materials.size(), 1u); // only what is used
    EXPECT_EQ(scene.materials[0].name, "wall");
    EXPECT_LT((scene.materials[0].reflectance - Rgb(0.2f, 0.4f, 0.6f)).abs().maxCoeff(), 1e-6f);
    EXPECT_EQ(scene.summary.line(), "1 faces, 1 triangles");
}

TEST(ObjMaterials, ComeFromAllFilesOfALine) {
    const TemporaryFolder folder;
    folder.write("a.mtl", "newmtl a\nKd 0.1 0.1 0.1\n");
    folder.write("b.mtl", "newmtl b\nKd 0.2 0.2 0.2\n");
    const Scene scene = load_obj(folder.write(
        "a.obj", "mtllib a.mtl b.mtl\n" + square_corners + "usemtl b\nf 1 2 3\nusemtl a\nf 1 3 4\n"));
    expect_sound(scene);
    ASSERT_EQ(scene.materials.size(), 2u);
    EXPECT_EQ(scene.materials[0].name, "b");
    EXPECT_TRUE((scene.materials[0].reflectance == 0.2f).all());
    EXPECT_EQ(scene.summary.line(), "2 faces, 2 triangles");
}

TEST(ObjMaterials, OfOneNumberAreGrey) {
    const TemporaryFolder folder;
    folder.write("a.mtl", "newmtl wall\n  Kd 0.25 # all three\n");
    const Scene scene =
        load_obj(folder.write("a.obj", "mtllib a.mtl\n" + square_corners + "usemtl wall\nf 1 2 3\n"));
    EXPECT_TRUE((scene.materials[0].reflectance == 0.25f).all());
}

TEST(ObjMaterials, OfATextureAloneAreWhiteTimesIt) {
    // Wherever they stand: what a material before them says is not theirs.
    const TemporaryFolder folder;
    write_picture(folder.path("picture.png"));
    const std::string textured = "newmtl wall\nmap_Kd picture.png\n", plain = "newmtl a\nKd 0.25 0.5 0.75\n";
    for (const std::string& mtl : {textured + plain, plain + textured, textured}) {
        folder.write("a.mtl", mtl);
        const Scene scene = load_obj(folder.write("a.obj", "mtllib a.mtl\n" + textured_square));
        expect_sound(scene);
        EXPECT_TRUE((scene.materials[0].reflectance == 0.999f).all()) << mtl;
        EXPECT_EQ(scene.summary.line(), "1 faces, 2 triangles");
    }
}

TEST(ObjMaterials, AreClampedAndCounted) {
    const TemporaryFolder folder;
    folder.write("a.mtl", "newmtl a\nKd 1 1 1\nnewmtl b\nKd -1 0.5 7\nnewmtl c\nKd 0.9 0.9 0.9\n");
    const Scene scene = load_obj(
        folder.write("a.obj", "mtllib a.mtl\n" + square_corners
                                  + "usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 3\n"));
    expect_sound(scene);
    EXPECT_TRUE((scene.materials[0].reflectance == 0.999f).all());
    EXPECT_TRUE((scene.materials[1].reflectance == Rgb(0, 0.5f, 0.999f)).all());
    EXPECT_EQ(scene.summary.clamped_reflectance, 2u);
}

TEST(ObjMaterials, AreGreyWhereTheMtlFileOrTheNameIsMissing) {
    const TemporaryFolder folder;
    folder.write("a.mtl", "newmtl wall\nKd 0.2 0.4 0.6\n");
    std::filesystem::create_directory(folder.path("folder.mtl"));
    for (const char* mtl : {"none.mtl", "folder.mtl", "."}) {
        const Scene scene = load_obj(folder.write(
            "a.obj", std::string("mtllib ") + mtl + "\n" + square_corners + "usemtl wall\nf 1 2 3\n"));
        expect_sound(scene);
        EXPECT_TRUE((scene.materials[0].reflectance == 0.5f).all());
        EXPECT_EQ(scene.summary.missing_files.size(), 1u);
        EXPECT_EQ(scene.summary.default_material, 1u);
    }
    const Scene scene = load_obj(folder.write(
        "a.obj", "mtllib a.mtl\n" + square_corners + "usemtl other\nf 1 2 3\nusemtl wall\nf 1 2 3\n"));
    expect_sound(scene);
    EXPECT_EQ(scene.summary.default_material, 1u);
    EXPECT_EQ(scene.materials.size(), 2u);
}

TEST(ObjMaterials, SurviveGarbageInTheMtlFile) {
    const TemporaryFolder folder;
    Rng rng(2, 0);
    std::string garbage = "newmtl wall\nKd 0.2";
    for (int i = 0; i < 20'000; ++i)
        garbage += static_cast<char>(rng.next());
    folder.write("a.mtl", garbage);
    expect_sound(load_obj(folder.write("a.obj", "mtllib a.mtl\n" + textured_square)));
}

TEST(ObjMaterials, AreFoundWhateverBlanksAndSlashesTheNamesHold) {
    const TemporaryFolder folder;
    folder.write("sub/my scene.mtl",
                 "newmtl my wall  \nKd 0.2 0.4 0.6\nmap_Kd .\\the picture.png \n");
    write_picture(folder.path("sub/the picture.png"));
    const Scene scene =
        load_obj(folder.write("a.obj", "mtllib sub\\my scene.mtl\r\n" + square_corners
                                           + "vt 0 0\nusemtl my wall \r\nf 1/1 2/1 3/1\r\n"));
    expect_sound(scene);
    EXPECT_EQ(scene.summary.line(), "1 faces, 1 triangles");
    EXPECT_EQ(scene.materials[0].name, "my wall");
    EXPECT_EQ(scene.textures.size(), 1u);
}

TEST(ObjTextures, AreDecodedFromSrgbAndStandUpright) {
    const TemporaryFolder folder;
    folder.write("sub/a.mtl", "newmtl wall\nKd 0.5 0.5 0.5\nmap_Kd picture.png\n");
    write_picture(folder.path("sub/picture.png")); // beside the MTL file, not the OBJ file
    const Scene scene = load_obj(folder.write("a.obj", "mtllib sub/a.mtl\n" + textured_square));
    expect_sound(scene);
    const Surface surface(scene);
    const auto seen_at = [&](float x, float y) {
        return surface.reflectance(surface.closest_hit({{x, y, 1}, -Vec3::UnitZ()}));
    };
    const auto expect_near = [](const Rgb& a, const Rgb& b) {
        EXPECT_LT((a - b).abs().maxCoeff(), 1e-4f) << a.transpose();
    };
    expect_near(seen_at(0.25f, 0.25f), Rgb::Constant(0.5f * 0.50289f)); // bottom left
    expect_near(seen_at(0.75f, 0.25f), {0.5f, 0, 0});
    expect_near(seen_at(0.25f, 0.75f), Rgb::Zero());
    expect_near(seen_at(0.75f, 0.75f), Rgb::Constant(0.5f)); // top right
}

TEST(ObjTextures, AreScaledAndShiftedAsTheirOptionsSay) {
    const TemporaryFolder folder;
    write_picture(folder.path("the picture.png"));
    for (const char* options : {"-s 2 -0.5 1 -o 0.25 0.125 0", "-s 2 -0.5 -o 0.25 0.125", "-o 0.25 0.125 -bm 1 -s 2 -0.5"}) {
        folder.write("a.mtl", std::string("newmtl wall\nKd 0.5 0.5 0.5\nmap_Kd ") + options
                                  + " the picture.png \nnewmtl plain\nKd 0.5 0.5 0.5\nmap_Kd the picture.png\n");
        const Scene scene = load_obj(folder.write("a.obj", "mtllib a.mtl\n" + textured_square + "usemtl plain\nf 1/1 2/2 3/3\n"));
        expect_sound(scene);
        EXPECT_EQ(scene.summary.line(), "2 faces, 3 triangles") << options;
        ASSERT_EQ(scene.textures.size(), 1u);
        const auto at = [&](std::size_t triangle, std::size_t corner) {
            return scene.texture_coordinates[scene.texture_indices[triangle][corner]];
        };
        EXPECT_EQ(at(0, 0), Vec2(0.25f, 0.125f)) << options;
        EXPECT_EQ(at(0, 2), Vec2(2.25f, -0.375f)) << options;
        EXPECT_EQ(at(1, 2), Vec2(0.25f, -0.375f)) << options;
        EXPECT_EQ(at(2, 2), Vec2(1.0f, 1.0f)) << options; // the other material's are its own
        EXPECT_EQ(scene.texture_coordinates.size(), 8u);
    }
}

TEST(ObjTextures, ThatAreMissingOrDamagedAreNamedOnceAndIgnored) {
    const TemporaryFolder folder;
    folder.write("text.png", "no picture");
    write_picture(folder.path("cut.png"));
    folder.write("cut.png", content_of(folder.path("cut.png")).substr(0, 45));
    std::filesystem::create_directory(folder.path("folder.png"));
    for (const char* name : {"none.png", "text.png", "cut.png", "folder.png"}) {
        folder.write("a.mtl", std::string("newmtl wall\nKd 0.2 0.4 0.6\nmap_Kd ") + name
                                  + "\nnewmtl other\nKd 0.1 0.1 0.1\nmap_Kd " + name + "\n");
        const Scene scene = load_obj(folder.write("a.obj", "mtllib a.mtl\n" + textured_square
                                                               + "usemtl other\nf 1/1 2/2 3/3\n"));
        expect_sound(scene);
        EXPECT_TRUE(scene.textures.empty());
        EXPECT_EQ(scene.summary.missing_files, std::vector<std::string>{folder.path(name)});
        EXPECT_NEAR(scene.materials[0].reflectance[0], 0.2f, 1e-6f);
    }
}

TEST(ObjPaths, ThatLeadOutsideTheFolderAreReadAndNamed) {
    const TemporaryFolder folder;
    folder.write("other/a.mtl", "newmtl wall\nmap_Kd picture.png\nmap_Bump ../scene/deep/flat.png\n");
    write_picture(folder.path("other/picture.png"));
    std::filesystem::create_directories(folder.path("scene/deep"));
    write_picture(folder.path("scene/deep/flat.png"));
    const Scene scene =
        load_obj(folder.write("scene/a.obj", "mtllib ../other/a.mtl\n" + textured_square));
    EXPECT_EQ(scene.textures.size(), 1u);
    EXPECT_EQ(scene.normal_maps.size(), 1u);
    const std::vector<std::string> outside = {folder.path("scene/../other/a.mtl"),
                                              folder.path("scene/../other/picture.png")};
    EXPECT_EQ(scene.summary.outside_files, outside);
    EXPECT_NE(scene.summary.line().find("; read from outside the scene's folder: " + outside[0] + ", "),
              std::string::npos)
        << scene.summary.line();
}

TEST(ObjPaths, AreFollowedThroughSymbolicLinks) {
    const TemporaryFolder folder;
    folder.write("elsewhere/a.mtl", "newmtl wall\nKd 0.2 0.4 0.6\n");
    std::filesystem::create_directory(folder.path("scene"));
    std::filesystem::create_symlink(folder.path("elsewhere/a.mtl"), folder.path("scene/a.mtl"));
    const std::string obj = folder.write("scene/a.obj", "mtllib a.mtl\n" + textured_square);
    EXPECT_EQ(load_obj(obj).summary.outside_files, std::vector<std::string>{folder.path("scene/a.mtl")});

    // A link to the whole scene leads nowhere else.
    std::filesystem::remove(folder.path("scene/a.mtl"));
    folder.write("scene/a.mtl", "newmtl wall\n");
    std::filesystem::create_directory_symlink(folder.path("scene"), folder.path("link"));
    EXPECT_TRUE(load_obj(folder.path("link/a.obj")).summary.outside_files.empty());
}

TEST(ObjPaths, ToWhatIsNoPictureOrMaterialAreNamedAsWell) {
    const TemporaryFolder folder;
    folder.write("a.mtl", "newmtl wall\nmap_Kd /etc/passwd\nmap_Bump /dev/zero\n");
    const Scene scene =
        load_obj(folder.write("a.obj", "mtllib /etc/passwd\nmtllib a.mtl\n" + textured_square));
    EXPECT_EQ(scene.summary.outside_files, std::vector<std::string>{"/etc/passwd"});
    const std::vector<std::string> unreadable = {"/etc/passwd", "/dev/zero"};
    EXPECT_EQ(scene.summary.missing_files, unreadable);
}

TEST(ObjPaths, InsideTheFolderNeedNoWord) {
    const TemporaryFolder folder;
    folder.write("sub/a.mtl", "newmtl wall\nmap_Kd ../picture.png\n");
    write_picture(folder.path("picture.png"));
    const Scene scene = load_obj(folder.write("a.obj", "mtllib sub/a.mtl\n" + textured_square));
    EXPECT_EQ(scene.textures.size(), 1u);
    EXPECT_EQ(scene.summary.line(), "1 faces, 2 triangles");
    EXPECT_EQ(scene.summary.outside_line(), "");
}

} // namespace
} // namespace afterglow
