#include "basis/candidates.h"
#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/parallel.h"
#include "tests/support/quad.h"
#include "tests/support/surface_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>

namespace afterglow {
namespace {

constexpr float between_rooms = 4.025f; // x in the middle of the wall of two_rooms

TEST(CandidateSource, StaysInTheRoomOfItsViewpoint) {
    const Scene scene = make_builtin_scene("builtin:two_rooms_closed");
    const Surface surface(scene);
    for (const float x : {1.0f, 7.0f}) {
        CandidateSource source(surface, {Vec3(x, 1.5f, 1.0f)}, 3);
        source.ensure(50'000);
        for (std::size_t i = 0; i < source.size(); ++i)
            ASSERT_EQ(source[i].at.position.x() < between_rooms, x < between_rooms) << i;
    }
}

TEST(CandidateSource, GoesThroughAnOpenDoor) {
    const Scene scene = make_builtin_scene("builtin:two_rooms");
    const Surface surface(scene);
    CandidateSource source(surface, {Vec3(1.0f, 1.5f, 1.0f)}, 3);
    source.ensure(50'000);
    std::size_t beyond = 0;
    for (std::size_t i = 0; i < source.size(); ++i)
        beyond += source[i].at.position.x() > between_rooms;
    EXPECT_GT(beyond, source.size() / 20);
}

TEST(CandidateSource, LiesOnSurfacesAndFacesTheOpenSide) {
    for (const char* name : {"builtin:cornell", "builtin:two_rooms", "builtin:sphere:0.5"}) {
        const Scene scene = make_builtin_scene(name);
        const Surface surface(scene);
        CandidateSource source(surface, {*scene.viewpoint}, 4);
        source.ensure(5000);
        for (std::size_t i = 0; i < 5000; ++i) {
            const Candidate& c = source[i];
            // The plane of the triangle that it claims to lie on.
            const Triangle& t = scene.triangles[c.hit.primitive];
            const Vec3& a = scene.positions[t[0]];
            const Vec3 normal =
                (scene.positions[t[1]] - a).cross(scene.positions[t[2]] - a).normalized();
            EXPECT_NEAR((c.at.position - a).dot(normal), 0.0f, 1e-5f) << name;
            EXPECT_NEAR(c.at.normal.norm(), 1.0f, 1e-5f);
            // These scenes are wound to their open side, and only that can be reached.
            EXPECT_GT(c.at.normal.dot(normal), 0.9f) << name;
        }
    }
}

TEST(CandidateSource, IsDistributedLikeTheLightThatReachesTheSurfaces) {
    // In a closed convex room diffuse particles become uniform over the area: after three bounces
    // each face of a cube has its sixth. Candidates of one path depend on each other, so that the
    // variance of a share is measured between groups of paths.
    const Scene scene = make_builtin_scene("builtin:furnace");
    const Surface surface(scene);
    constexpr int groups = 16;
    Eigen::ArrayXXd share(6, groups);
    for (int g = 0; g < groups; ++g) {
        CandidateSource source(surface, {Vec3(0.3f, -0.2f, 0.5f)}, 100 + g);
        source.ensure(1);
        share.col(g).setZero();
        for (std::size_t i = 0; i < source.size(); ++i) {
            Index axis = 0;
            const float side = source[i].at.position.cwiseAbs().maxCoeff(&axis);
            ASSERT_NEAR(side, 1.0f, 1e-5f);
            share(2 * axis + (source[i].at.position[axis] > 0.0f), g) +=
                1.0 / static_cast<double>(source.size());
        }
    }
    for (int face = 0; face < 6; ++face) {
        const double mean = share.row(face).mean();
        const double error =
            std::sqrt((share.row(face) - mean).square().sum() / (groups * (groups - 1.0)));
        EXPECT_NEAR(mean, 1.0 / 6.0, 4.0 * error) << "face " << face;
        EXPECT_LT(error, 5e-4) << "this test could not see a difference of 1 %";
    }
}

TEST(CandidateSource, MeasuresTheTypicalLengthOfARay) {
    // Uniform and isotropic chords of a convex body have the mean length 4 V / A (Cauchy).
    const Scene scene = make_builtin_scene("builtin:furnace");
    const Surface surface(scene);
    CandidateSource source(surface, {Vec3::Zero()}, 5);
    source.ensure(100'000);
    EXPECT_NEAR(source.mean_ray_length(), 4.0 * 8.0 / 24.0, 0.01);
}

TEST(CandidateSource, DoesNotDependOnThreadsOrTheStepsItIsMadeIn) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const auto make = [&](int threads, int steps) {
        const ThreadLimit limit(threads);
        auto source =
            std::make_unique<CandidateSource>(surface, std::vector<Vec3>{*scene.viewpoint}, 6);
        for (int step = 1; step <= steps; ++step)
            source->ensure(static_cast<std::size_t>(40'000 * step / steps));
        return source;
    };
    const auto one = make(1, 1), two = make(2, 5);
    for (std::size_t i = 0; i < 40'000; ++i) {
        ASSERT_EQ((*one)[i].at.position, (*two)[i].at.position);
        ASSERT_EQ((*one)[i].at.normal, (*two)[i].at.normal);
    }
}

TEST(CandidateSource, IsPatientWhereLittleIsReached) {
    // In the open, beside the only thing on a wide ground: of thousands of particles few leave candidates.
    Scene scene = make_ground(20.0f);
    for (const auto& [u, v] : {std::pair<Vec3, Vec3>{Vec3::UnitY(), Vec3::UnitZ()}, {Vec3::UnitX(), Vec3::UnitY()}})
        add_quad(scene, {Vec3(0, 0, 0), u, u + v, v});
    const Surface surface(scene);
    CandidateSource source(surface, {Vec3(-3, 1.7f, -3)}, 1);
    source.ensure(1);
    const std::size_t first = source.size();
    EXPECT_LT(first, 20u);
    source.ensure(first + 100);
    EXPECT_GE(source.size(), first + 100);
}

TEST(CandidateSource, RefusesAViewpointFromWhichNoSurfaceIsReached) {
    const Scene empty;
    const Surface nothing(empty);
    EXPECT_THROW(CandidateSource(nothing, {Vec3::Zero()}, 1), Error);
}

/// The scene with every triangle wound the other way.
Scene reversed(Scene scene) {
    for (Triangle& t : scene.triangles)
        std::swap(t[1], t[2]);
    return scene;
}

TEST(FindViewpoints, FindsEveryRoomHoweverTheSceneIsWound) {
    const Scene good = make_builtin_scene("builtin:two_rooms_closed");
    for (const Scene& scene : {good, reversed(good)}) {
        const Surface surface(scene);
        for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
            bool first = false, second = false;
            for (const Vec3& p : find_viewpoints(surface, seed)) {
                EXPECT_TRUE(scene.bounds().contains(p));
                first |= p.x() < 4.0f;
                second |= p.x() > 4.05f;
                EXPECT_TRUE(p.x() < 4.0f || p.x() > 4.05f) << "in the wall, seed " << seed;
            }
            EXPECT_TRUE(first && second) << "seed " << seed;
        }
    }
}

TEST(FindViewpoints, KeepsOutOfSolidsHoweverTheSceneIsWound) {
    const Scene good = make_builtin_scene("builtin:cornell");
    const Vec3 middle(0.278f, 0.45f, 0.28f); // in the open, above both blocks
    for (const Scene& scene : {good, reversed(good)}) {
        const Surface surface(scene);
        for (const std::uint64_t seed : {1, 2, 3, 4, 5})
            for (const Vec3& p : find_viewpoints(surface, seed))
                EXPECT_FALSE(surface.blocked(p, middle)) << p.transpose() << ", seed " << seed;
    }
}

TEST(FindViewpoints, NeedsOneWhereAllIsConnected) {
    for (const char* name : {"builtin:furnace", "builtin:sphere:0.5", "builtin:two_rooms"}) {
        const Scene scene = make_builtin_scene(name);
        const Surface surface(scene);
        for (const std::uint64_t seed : {1, 2, 3}) {
            const std::vector<Vec3> found = find_viewpoints(surface, seed);
            ASSERT_EQ(found.size(), 1u) << name;
            // Inside, not in the wall.
            EXPECT_FALSE(surface.blocked(found[0], *scene.viewpoint)
                         && std::string(name) != "builtin:two_rooms");
        }
    }
}

TEST(FindViewpoints, FindsRoomsOnAGroundThatReachesFar) {
    Scene scene = make_builtin_scene("builtin:two_rooms");
    add_quad(scene, {Vec3(-400, -0.2f, -400), Vec3(-400, -0.2f, 400), Vec3(400, -0.2f, 400), Vec3(400, -0.2f, -400)});
    const Surface surface(scene);
    for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
        bool found = false; // a place in one of the rooms
        for (const Vec3& p : find_viewpoints(surface, seed))
            for (const float x : {1.0f, 7.0f}) found |= !surface.blocked(p, Vec3(x, 1.5f, 1.0f));
        EXPECT_TRUE(found) << "seed " << seed;
    }
}

TEST(FindViewpoints, FallsBackToTheMiddle) {
    const Scene empty;
    const Surface nothing(empty);
    EXPECT_EQ(find_viewpoints(nothing, 1).size(), 1u);
}

} // namespace
} // namespace afterglow
