#include "tests/stability/scenes.h"
#include "tests/support/surface_samples.h"
#include "transport/path_tracer.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace afterglow {
namespace {

TEST(PlacesOn, LieOneInEachCellAndFaceTheFront) {
    const Quad quad{{1, 2, 3}, {0, 0, 4}, {2, 0, 0}};
    const std::vector<SurfacePoint> places = places_on(quad, 32, 1);
    ASSERT_EQ(places.size(), 32u); // 8 along u, 4 along v, cells of half a metre
    for (std::size_t i = 0; i < places.size(); ++i) {
        const Vec3 at = places[i].position - quad.corner;
        EXPECT_EQ(static_cast<std::size_t>(at.z() / 0.5f), i % 8);
        EXPECT_EQ(static_cast<std::size_t>(at.x() / 0.5f), i / 8);
        EXPECT_EQ(at.y(), 0.0f);
        EXPECT_EQ(places[i].normal, Vec3::UnitY());
    }
}

TEST(SceneBuilder, TurnsBoxesOutwardsAndRoomsInwards) {
    for (const bool is_room : {false, true}) {
        SceneBuilder builder;
        if (is_room)
            builder.add_room({1, 2, 3}, {2, 4, 6});
        else
            builder.add_box({1, 2, 3}, {2, 4, 6});
        const Scene scene = builder.finish({1.5f, 3, 4.5f});
        ASSERT_EQ(scene.triangles.size(), 12u);
        double volume = 0.0; // of the pyramids from the origin, positive where fronts look away
        for (const Triangle& t : scene.triangles)
            volume +=
                scene.positions[t[0]].dot(scene.positions[t[1]].cross(scene.positions[t[2]])) / 6.0;
        EXPECT_NEAR(volume, is_room ? -6.0 : 6.0, 1e-5);
    }
}

double area(const Scene& scene) {
    double sum = 0.0;
    for (const Triangle& t : scene.triangles) {
        const Vec3& a = scene.positions[t[0]];
        sum += 0.5 * (scene.positions[t[1]] - a).cross(scene.positions[t[2]] - a).norm();
    }
    return sum;
}

TEST(Clutter, HasTheAreaThatIsAskedForWhateverTheNumber) {
    const double shell = 2.0 * (5.0 * 2.8 + 5.0 * 4.0 + 2.8 * 4.0);
    for (const int count : {10, 1000})
        EXPECT_NEAR(area(clutter(count, 10.0f, 1).scene), shell + 10.0, 1e-2) << count;
}

/// A scene in two parts of which one is dark.
struct Parted {
    const char* name;
    LitScene lit;
    Vec3 in_the_light, in_the_dark;
};

/// What families of closed walls measure is the method's leak: the scenes themselves have none.
TEST(ClosedScenes, AreDarkBeyondTheWallForThePathTracer) {
    const Vec3 corner(0.5f, 1.4f, 0.5f), beside_corner(2.5f, 1.4f, 2.0f);
    const Vec3 box = Vec3::Constant(2.5f), beside_box(1.0f, 2.5f, 1.0f);
    for (const float wall : {0.0f, 0.001f, 0.3f}) {
        const Vec3 second_room(6.0f + wall, 1.4f, 2.0f);
        for (const Parted& parted : {
                 Parted{"two rooms", two_rooms(wall, 0.0f), {2, 1.4f, 2}, second_room},
                 Parted{"two rooms, floor through",
                        two_rooms(wall, 0.0f, Shell::continuous),
                        {2, 1.4f, 2},
                        second_room},
                 Parted{"corner, lit outside", closed_corner(wall, LightAt::outside), beside_corner,
                        corner},
                 Parted{"corner, lit inside", closed_corner(wall, LightAt::inside), corner,
                        beside_corner},
                 Parted{"box, lit outside", box_in_room(wall, true, LightAt::outside), beside_box,
                        box},
                 Parted{"box, lit inside", box_in_room(wall, true, LightAt::inside), box,
                        beside_box},
             }) {
            const Surface surface(parted.lit.scene);
            for (const bool dark : {false, true}) {
                const IrradianceEstimate estimate = estimate_irradiance(
                    surface, {&parted.lit.light, 1},
                    points_in_sight(surface, dark ? parted.in_the_dark : parted.in_the_light, 500,
                                    1),
                    {.samples = 64, .strategy = PathStrategy::connected});
                if (dark) {
                    EXPECT_EQ(estimate.direct.maxCoeff(), 0.0f) << parted.name << ' ' << wall;
                    EXPECT_EQ(estimate.indirect.maxCoeff(), 0.0f) << parted.name << ' ' << wall;
                } else {
                    EXPECT_GT(estimate.indirect.mean(), 0.0f) << parted.name << ' ' << wall;
                }
            }
        }
    }
}

} // namespace
} // namespace afterglow
