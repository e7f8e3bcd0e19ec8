#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/sampling.h"
#include "core/surface.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <map>
#include <set>

namespace afterglow {
namespace {

Vec3 corner(const Scene& scene, const Triangle& t, int k) {
    return scene.positions[t[k]];
}

double area(const Scene& scene) {
    double sum = 0.0;
    for (const Triangle& t : scene.triangles)
        sum += 0.5
               * (corner(scene, t, 1) - corner(scene, t, 0))
                     .cast<double>()
                     .cross((corner(scene, t, 2) - corner(scene, t, 0)).cast<double>())
                     .norm();
    return sum;
}

/// Of the air inside a closed scene, whose triangles face inwards.
double volume(const Scene& scene) {
    double sum = 0.0;
    for (const Triangle& t : scene.triangles)
        sum -=
            corner(scene, t, 0)
                .cast<double>()
                .dot(corner(scene, t, 1).cast<double>().cross(corner(scene, t, 2).cast<double>()))
            / 6.0;
    return sum;
}

/// True where each edge is used twice, once in each direction.
bool is_closed(const Scene& scene) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
    for (const Triangle& t : scene.triangles)
        for (int k = 0; k < 3; ++k)
            ++uses[{t[k], t[(k + 1) % 3]}];
    for (const auto& [edge, count] : uses) {
        const auto back = uses.find({edge.second, edge.first});
        if (count != 1 || back == uses.end() || back->second != 1) return false;
    }
    return true;
}

const char* const closed_names[] = {"builtin:furnace", "builtin:furnace:0.9", "builtin:sphere:0.25",
                                    "builtin:two_rooms", "builtin:two_rooms_closed"};

TEST(BuiltinScenes, AreClosedWhereTheyClaimToBe) {
    for (const char* name : closed_names)
        EXPECT_TRUE(is_closed(make_builtin_scene(name))) << name;
}

TEST(BuiltinScenes, ShowTheirFrontsToTheViewpoint) {
    std::set<std::string> names(std::begin(closed_names), std::end(closed_names));
    names.insert("builtin:cornell");
    for (const std::string& name : names) {
        const Scene scene = make_builtin_scene(name);
        const Surface surface(scene);
        ASSERT_TRUE(scene.viewpoint.has_value()) << name;
        for (std::uint32_t i = 0; i < 4096; ++i) {
            const Hit hit =
                surface.closest_hit({*scene.viewpoint, sample_sphere(scrambled_sobol2(i, 1))});
            if (name != "builtin:cornell") {
                ASSERT_TRUE(hit) << name;
            }
            ASSERT_FALSE(hit && hit.back_side) << name << " triangle " << hit.primitive;
        }
    }
}

TEST(BuiltinScenes, HaveOneMaterialATriangleThatReflectsLessThanAll) {
    for (const auto& [name, about] : builtin_scene_names()) {
        if (name.ends_with("RHO")) continue;
        const Scene scene = load_scene(name);
        EXPECT_EQ(scene.name, name);
        EXPECT_EQ(scene.summary.triangles, scene.triangles.size());
        ASSERT_EQ(scene.material_index.size(), scene.triangles.size());
        for (const std::uint32_t m : scene.material_index)
            ASSERT_LT(m, scene.materials.size());
        for (const Material& m : scene.materials)
            EXPECT_TRUE((m.reflectance >= 0.0f).all() && (m.reflectance < 1.0f).all()) << name;
    }
}

TEST(Furnace, IsABoxOfSideTwoWithTheReflectanceAskedFor) {
    const Scene scene = make_builtin_scene("builtin:furnace:0.75");
    EXPECT_DOUBLE_EQ(area(scene), 24.0);
    EXPECT_DOUBLE_EQ(volume(scene), 8.0);
    EXPECT_TRUE((scene.materials[0].reflectance == 0.75f).all());
    EXPECT_TRUE((make_builtin_scene("builtin:furnace").materials[0].reflectance == 0.5f).all());
}

TEST(Sphere, IsRoundAndSeenFromTheInside) {
    const Scene scene = make_builtin_scene("builtin:sphere:0");
    EXPECT_EQ(scene.triangles.size(), 20480u);
    EXPECT_EQ(scene.positions.size(), 10242u); // Euler: V = 2 + T / 2
    for (const Vec3& p : scene.positions)
        EXPECT_NEAR(p.norm(), 1.0f, 1e-6f);
    // Inscribed: a little smaller than the sphere. Edges of about 1/26 rad lose 0.04 % of the area.
    const double pi = static_cast<double>(EIGEN_PI);
    EXPECT_NEAR(area(scene) / (4.0 * pi), 1.0, 1e-3);
    EXPECT_LT(area(scene), 4.0 * pi);
    EXPECT_NEAR(volume(scene) / (4.0 / 3.0 * pi), 1.0, 1e-3);
}

TEST(TwoRooms, HaveTheVolumeAndAreaOfTheirPlan) {
    const double rooms = 2 * 4 * 4 * 2.8, walls = 2 * (2 * 4 * 4 + 4 * 4 * 2.8);
    const Scene closed = make_builtin_scene("builtin:two_rooms_closed");
    EXPECT_NEAR(volume(closed), rooms, 1e-4);
    EXPECT_NEAR(area(closed), walls, 1e-4);
    const Scene open = make_builtin_scene("builtin:two_rooms");
    EXPECT_NEAR(volume(open), rooms + 0.05 * 0.9 * 2.0, 1e-4);
    // The door takes its outline from both sides of the wall and adds threshold, lintel and jambs.
    EXPECT_NEAR(area(open), walls - 2 * 0.9 * 2.0 + 0.05 * (2 * 0.9 + 2 * 2.0), 1e-4);
}

TEST(TwoRooms, SeeEachOtherThroughTheDoorAlone) {
    const Scene open = make_builtin_scene("builtin:two_rooms");
    const Scene closed = make_builtin_scene("builtin:two_rooms_closed");
    const Surface with_door(open), without(closed);
    const Vec3 here(2, 1, 2), there(6, 1, 2), aside(6, 1, 0.2f);
    EXPECT_FALSE(with_door.blocked(here, there));
    EXPECT_TRUE(with_door.blocked(here, aside));
    EXPECT_TRUE(without.blocked(here, there));
    const Hit far_wall = with_door.closest_hit({here, Vec3::UnitX()});
    EXPECT_NEAR(far_wall.distance, 6.05f, 1e-5f);
    const Rgb red = with_door.reflectance(far_wall);
    EXPECT_GT(red[0], 3.0f * red[1]);
}

TEST(Cornell, HasItsMeasuredSizes) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Eigen::AlignedBox3f box = scene.bounds();
    EXPECT_LT(box.min().norm(), 1e-6f);
    EXPECT_LT((box.max() - Vec3(0.556f, 0.5488f, 0.5592f)).norm(), 1e-6f);
    EXPECT_EQ(scene.triangles.size(), 30u);

    const Surface surface(scene);
    const auto height_below = [&](float x, float z) {
        return 0.5f - surface.closest_hit({{x, 0.5f, z}, -Vec3::UnitY()}).distance;
    };
    EXPECT_NEAR(height_below(0.185f, 0.17f), 0.165f, 1e-5f); // short block
    EXPECT_NEAR(height_below(0.37f, 0.35f), 0.330f, 1e-5f);  // tall block
    EXPECT_NEAR(height_below(0.05f, 0.05f), 0.0f, 1e-5f);    // floor
}

TEST(Cornell, HasItsRedWallOnTheLeftAndItsFrontOpen) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const Vec3 eye(0.278f, 0.273f, -0.8f), middle(0.278f, 0.4f, 0.1f);
    EXPECT_FALSE(surface.blocked(eye, middle));
    EXPECT_FALSE(surface.closest_hit({middle, -Vec3::UnitZ()}));
    const Vec3 right = Vec3::UnitZ().cross(Vec3::UnitY()); // of a viewer who looks along +z
    const Rgb at_left = surface.reflectance(surface.closest_hit({middle, -right}));
    const Rgb at_right = surface.reflectance(surface.closest_hit({middle, right}));
    EXPECT_GT(at_left[0], 5.0f * at_left[1]);
    EXPECT_GT(at_right[1], 3.0f * at_right[0]);
}

TEST(BuiltinScenes, RefuseUnknownNamesAndImpossibleReflectances) {
    for (const char* name : {"builtin:", "builtin:none", "builtin:sphere", "builtin:sphere:",
                             "builtin:sphere:1", "builtin:furnace:-0.1", "builtin:furnace:nan",
                             "builtin:furnace:0.5x", "builtin:furnace:0,5", "builtin:cornell:1"})
        EXPECT_THROW(load_scene(name), UsageError) << name;
    try {
        load_scene("builtin:none");
    } catch (const UsageError& e) {
        for (const auto& [name, about] : builtin_scene_names())
            EXPECT_NE(std::string(e.what()).find(name), std::string::npos) << e.what();
    }
}

} // namespace
} // namespace afterglow
