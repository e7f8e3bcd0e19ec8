#include "core/builtin_scenes.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "core/surface.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <atomic>

namespace afterglow {
namespace {

using Vec3d = Eigen::Vector3d;

Vec3 random_point(Rng& rng) {
    const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
    return {2.0f * x - 1.0f, 2.0f * y - 1.0f, 2.0f * z - 1.0f};
}

Vec3 random_direction(Rng& rng) {
    const float u = rng.uniform(), v = rng.uniform();
    return sample_sphere({u, v});
}

/// Small triangles strewn in the box [-1, 1]^3, half of them with vertex normals.
Scene triangle_soup(int count) {
    Scene scene;
    Rng rng(3, 0);
    scene.materials.push_back({"a", {0.1f, 0.2f, 0.3f}, no_index});
    scene.materials.push_back({"b", {0.4f, 0.5f, 0.6f}, no_index});
    for (int i = 0; i < count; ++i) {
        const Vec3 centre = random_point(rng);
        const auto first = static_cast<std::uint32_t>(scene.positions.size());
        for (int k = 0; k < 3; ++k)
            scene.positions.push_back(centre + 0.2f * random_point(rng));
        const Triangle triangle{first, first + 1, first + 2};
        scene.triangles.push_back(triangle);
        scene.material_index.push_back(static_cast<std::uint32_t>(i % 2));
        for (int k = 0; k < 3; ++k)
            scene.normals.push_back(random_direction(rng));
        scene.normal_indices.push_back(i % 2 ? triangle : Triangle{no_index, no_index, no_index});
    }
    return scene;
}

/// The oracle: Moeller and Trumbore's test on every triangle, in double precision. `margin` becomes
/// small where some ray-triangle test is a close call.
struct Answer {
    double distance = std::numeric_limits<double>::infinity(), second = distance;
    std::uint32_t primitive = no_index;
    double margin = 1.0;
};
Answer brute_force(const Scene& scene, const Ray& ray) {
    Answer answer;
    const Vec3d o = ray.origin.cast<double>(), d = ray.direction.cast<double>();
    for (std::uint32_t i = 0; i < scene.triangles.size(); ++i) {
        const Triangle& t = scene.triangles[i];
        const Vec3d a = scene.positions[t[0]].cast<double>();
        const Vec3d ab = scene.positions[t[1]].cast<double>() - a;
        const Vec3d ac = scene.positions[t[2]].cast<double>() - a;
        const Vec3d p = d.cross(ac);
        const double determinant = ab.dot(p);
        const Vec3d s = o - a, q = s.cross(ab);
        const double u = s.dot(p) / determinant, v = d.dot(q) / determinant;
        const double distance = ac.dot(q) / determinant;
        const double inside = std::min({u, v, 1.0 - u - v});
        if (distance > -1e-4 && std::abs(distance) < 1e3)
            answer.margin = std::min({answer.margin, std::abs(inside), std::abs(distance)});
        if (inside < 0.0 || !(distance > 0.0)) continue;
        if (distance < answer.distance) {
            answer.second = answer.distance;
            answer.distance = distance;
            answer.primitive = i;
        } else {
            answer.second = std::min(answer.second, distance);
        }
    }
    return answer;
}

std::vector<Ray> random_rays(int count, std::uint64_t seed) {
    Rng rng(seed, 0);
    std::vector<Ray> rays;
    for (int i = 0; i < count; ++i) {
        const Vec3 origin = random_point(rng);
        rays.push_back({origin, random_direction(rng)});
    }
    return rays;
}

TEST(Surface, MeetsWhatBruteForceMeets) {
    const Scene scene = triangle_soup(300);
    const Surface surface(scene);
    int compared = 0, hits = 0;
    for (const Ray& ray : random_rays(5000, 4)) {
        const Answer answer = brute_force(scene, ray);
        // Close calls (an edge, two surfaces at one depth) may fall either way in single precision.
        if (answer.margin < 1e-4 || answer.second - answer.distance < 1e-4) continue;
        ++compared;
        const Hit hit = surface.closest_hit(ray);
        ASSERT_EQ(hit.primitive, answer.primitive);
        EXPECT_EQ(surface.occluded(ray), bool(hit));
        if (!hit) continue;
        ++hits;
        EXPECT_NEAR(hit.distance, answer.distance, 1e-4);
        const Vec3 place = ray.origin + hit.distance * ray.direction;
        EXPECT_LT((surface.point(hit).position - place).norm(), 1e-5f);
    }
    EXPECT_GT(compared, 4000);
    EXPECT_GT(hits, 1000);
}

TEST(Surface, IsOccludedOnlyBeforeTheEndOfTheRay) {
    const Scene scene = triangle_soup(300);
    const Surface surface(scene);
    int hits = 0;
    for (Ray ray : random_rays(2000, 5)) {
        const Hit hit = surface.closest_hit(ray);
        if (!hit || hit.distance < 1e-3f) continue;
        ++hits;
        ray.length = 0.999f * hit.distance;
        EXPECT_FALSE(surface.occluded(ray));
        EXPECT_FALSE(surface.closest_hit(ray));
        EXPECT_FALSE(surface.blocked(ray.origin, ray.origin + ray.length * ray.direction));
        ray.length = 1.001f * hit.distance;
        EXPECT_TRUE(surface.occluded(ray));
        EXPECT_TRUE(surface.blocked(ray.origin, ray.origin + ray.length * ray.direction));
    }
    EXPECT_GT(hits, 500);
}

TEST(Surface, AnswersPacketsLikeSingleRays) {
    const Scene scene = triangle_soup(300);
    const Surface surface(scene);
    for (const int count : {0, 1, 7, 8, 9, 1001}) {
        const std::vector<Ray> rays = random_rays(count, 6);
        std::vector<Hit> hits(rays.size());
        for (const bool coherent : {false, true}) {
            surface.closest_hits(rays, hits, coherent);
            for (std::size_t i = 0; i < rays.size(); ++i) {
                const Hit single = surface.closest_hit(rays[i]);
                ASSERT_EQ(hits[i].primitive, single.primitive);
                if (!single) continue;
                EXPECT_NEAR(hits[i].distance, single.distance, 1e-5f);
                EXPECT_EQ(hits[i].back_side, single.back_side);
            }
        }
    }
}

TEST(Surface, TellsOfManySegmentsLikeOfSingleOnes) {
    const Scene scene = triangle_soup(300);
    const Surface surface(scene);
    for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 1001u}) {
        std::vector<Vec3> from, to;
        for (const Ray& ray : random_rays(static_cast<int>(count), 7)) {
            from.push_back(ray.origin);
            to.push_back(from.size() % 5 == 0 ? ray.origin : Vec3(ray.origin + 0.5f * ray.direction)); // also of no length
        }
        std::vector<std::uint8_t> blocked(count, 2);
        surface.blocked(from, to, blocked);
        std::size_t sum = 0;
        for (std::size_t i = 0; i < count; ++i) {
            EXPECT_EQ(blocked[i], surface.blocked(from[i], to[i])) << i;
            sum += blocked[i];
        }
        if (count > 1000) {
            EXPECT_GT(sum, 100u);
            EXPECT_LT(sum, 900u);
        }
    }
}

TEST(Surface, MovesPlacesOntoTheClosestSurfaceAlongTheirNormal) {
    const Scene scene = make_builtin_scene("builtin:sphere:0.5"); // of radius 1, so that places may be 2 mm off
    const Surface surface(scene);
    Rng rng(3, 0);
    std::vector<SurfacePoint> on, off;
    for (int i = 0; i < 500; ++i) {
        const Hit hit = surface.closest_hit({Vec3::Zero(), sample_sphere({rng.uniform(), rng.uniform()})});
        ASSERT_TRUE(hit);
        on.push_back(surface.point(hit));
        on.back().normal = surface.geometric_normal(hit);
        off.push_back(on.back());
        off.back().position += 1e-3f * (2.0f * rng.uniform() - 1.0f) * off.back().normal;
    }
    std::vector<SurfacePoint> same = on;
    EXPECT_EQ(surface.move_onto_surfaces(same).moved, 0);
    for (std::size_t i = 0; i < on.size(); ++i) EXPECT_EQ(same[i].position, on[i].position);
    const PlacesMoved moved = surface.move_onto_surfaces(off);
    EXPECT_GT(moved.moved, 450); // else they were within rounding
    EXPECT_EQ(moved.lost, 0);
    EXPECT_NEAR(moved.farthest, 1e-3f, 5e-5f);
    for (std::size_t i = 0; i < on.size(); ++i) EXPECT_LT((off[i].position - on[i].position).norm(), 2.0f * surface.lift());

    std::vector<SurfacePoint> far = {{Vec3(0.0f, -0.9f, 0.0f), Vec3::UnitY()}};
    EXPECT_EQ(surface.move_onto_surfaces(far).lost, 1);
    EXPECT_EQ(far[0].position, Vec3(0.0f, -0.9f, 0.0f));
}

TEST(Surface, LeavesPlacesInNarrowGapsWhereTheyAre) {
    Scene scene = make_builtin_scene("builtin:furnace"); // from -1 to 1
    const auto first = static_cast<std::uint32_t>(scene.positions.size());
    for (const Vec3& corner : {Vec3(-0.5f, -0.9999f, -0.5f), Vec3(0.5f, -0.9999f, -0.5f), Vec3(0.0f, -0.9999f, 0.5f)})
        scene.positions.push_back(corner); // a sheet a ten thousandth above the floor
    scene.triangles.push_back({first, first + 1, first + 2});
    scene.material_index.push_back(0);
    const Surface surface(scene);
    std::vector<SurfacePoint> places = {{Vec3(0.0f, -1.0f, 0.0f), Vec3::UnitY()},
                                        {Vec3(0.0f, -0.9999f, 0.0f), Vec3::UnitY()},
                                        {Vec3(0.0f, -0.9999f, 0.0f), -Vec3::UnitY()},
                                        {Vec3(0.0f, -0.99997f, 0.0f), Vec3::UnitY()}};
    EXPECT_EQ(surface.move_onto_surfaces(places).moved, 1);
    EXPECT_EQ(places[0].position.y(), -1.0f);
    EXPECT_EQ(places[1].position.y(), -0.9999f);
    EXPECT_EQ(places[2].position.y(), -0.9999f);
    EXPECT_NEAR(places[3].position.y(), -1.0f, 1e-6f); // of both the closer
}

TEST(Surface, TurnsItsNormalsToTheViewer) {
    const Scene scene = triangle_soup(300);
    const Surface surface(scene);
    int fronts = 0, backs = 0;
    for (const Ray& ray : random_rays(5000, 7)) {
        const Hit hit = surface.closest_hit(ray);
        if (!hit) continue;
        ++(hit.back_side ? backs : fronts);
        const Vec3 geometric = surface.geometric_normal(hit), shading = surface.point(hit).normal;
        EXPECT_LT(geometric.dot(ray.direction), 1e-5f);
        EXPECT_NEAR(geometric.norm(), 1.0f, 1e-5f);
        EXPECT_NEAR(shading.norm(), 1.0f, 1e-5f);
        EXPECT_GT(shading.dot(geometric), 0.0f);
        if (scene.normal_indices[hit.primitive][0] == no_index) {
            EXPECT_EQ(shading, geometric);
        }
    }
    EXPECT_GT(fronts, 500);
    EXPECT_GT(backs, 500);
}

TEST(Surface, HasTheNormalsOfNeedlesAndOfLargeAndSmallTriangles) {
    // The oracle is in long double, whose mantissa holds the products of floats whole.
    using Vec3l = Eigen::Matrix<long double, 3, 1>;
    Rng rng(8, 0);
    for (const float size : {1e-9f, 1.0f, 1e9f})
        for (const float width : {1.0f, 1e-3f, 1e-6f}) // of the triangle ÷ its length
            for (int k = 0; k < 100; ++k) {
                const Vec3 along = random_direction(rng), middle = size * random_point(rng);
                const Vec3 tip = middle + 0.5f * size * along + size * width * random_direction(rng);
                Scene scene;
                scene.positions = {middle - size * along, middle + size * along, tip};
                scene.triangles = {{0, 1, 2}};
                scene.material_index = {0};
                scene.materials.push_back({"a", Rgb::Constant(0.5f), no_index});
                const auto corner = [&](std::size_t i) -> Vec3l { return scene.positions[i].cast<long double>(); };
                const Vec3l cross = (corner(1) - corner(0)).cross(corner(2) - corner(0));
                if (cross.norm() == 0.0L) continue; // of three rounded corners on a line
                const Surface surface(scene);
                Hit hit;
                hit.primitive = 0;
                const Vec3 found = surface.geometric_normal(hit);
                EXPECT_LT((found.cast<long double>() - cross.normalized()).norm(), 1e-6L) << size << " " << width;
            }
}

TEST(Surface, TellsTheAngleToLargeAndSmallTriangles) {
    for (const float size : {1e-8f, 1.0f, 1e11f}) {
        Scene scene;
        scene.positions = {{-size, 0, -size}, {0, 0, size}, {size, 0, -size}};
        scene.triangles = {{0, 1, 2}};
        scene.material_index = {0};
        scene.materials.push_back({"a", Rgb::Constant(0.5f), no_index});
        const Surface surface(scene);
        const Ray ray{size * Vec3(0.3f, 0.4f, 0.0f), Vec3(-0.6f, -0.8f, 0.0f)};
        Hit of_packet;
        surface.closest_hits({&ray, 1}, {&of_packet, 1});
        for (const Hit& hit : {surface.closest_hit(ray), of_packet}) {
            ASSERT_TRUE(hit) << size;
            EXPECT_NEAR(hit.cosine, 0.8f, 1e-5f) << size;
        }
    }
}

TEST(Surface, InterpolatesVertexNormals) {
    Scene scene;
    scene.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    scene.triangles = {{0, 1, 2}};
    scene.material_index = {0};
    scene.materials = {{}};
    scene.normals = {Vec3(0, 0, 1), Vec3(0.6f, 0, 0.8f)};
    scene.normal_indices = {{0, 1, 0}};
    const Surface surface(scene);
    const Hit hit = surface.closest_hit({{0.25f, 0.25f, 1}, -Vec3::UnitZ()});
    ASSERT_TRUE(hit);
    const Vec3 expected = Vec3(0.25f * 0.6f, 0, 0.75f + 0.25f * 0.8f).normalized();
    EXPECT_LT((surface.point(hit).normal - expected).norm(), 1e-5f);
    const Hit back = surface.closest_hit({{0.25f, 0.25f, -1}, Vec3::UnitZ()});
    EXPECT_TRUE(back.back_side);
    EXPECT_LT((surface.point(back).normal + expected).norm(), 1e-5f);
}

TEST(Surface, MultipliesReflectanceByTheTexture) {
    Scene scene;
    scene.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    scene.triangles = {{0, 1, 2}, {0, 2, 3}};
    scene.material_index = {0, 0};
    scene.materials = {{"picture", Rgb::Constant(0.5f), 0}};
    scene.texture_coordinates = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    scene.texture_indices = {{0, 1, 2}, {no_index, no_index, no_index}};
    scene.textures = {{2, 1, {1, 0, 0, 0, 1, 0}}}; // red, green
    const Surface surface(scene);
    const auto seen_at = [&](float x, float y) {
        return surface.reflectance(surface.closest_hit({{x, y, 1}, -Vec3::UnitZ()}));
    };
    EXPECT_LT((seen_at(0.25f, 0.1f) - Rgb(0.5f, 0, 0)).abs().maxCoeff(), 1e-5f);
    EXPECT_LT((seen_at(0.75f, 0.1f) - Rgb(0, 0.5f, 0)).abs().maxCoeff(), 1e-5f);
    EXPECT_LT((seen_at(0.25f, 0.9f) - Rgb::Constant(0.5f)).abs().maxCoeff(), 1e-5f);
}

TEST(Surface, LetsNoRayEscapeFromClosedScenes) {
    // Half of the rays start in the air, half on the surface, lifted off it.
    for (const char* name : {"builtin:furnace", "builtin:sphere:0.5", "builtin:two_rooms"}) {
        const Scene scene = make_builtin_scene(name);
        const Surface surface(scene);
        std::atomic<int> escaped{0};
        parallel_for(500'000, [&](Index i) {
            Rng rng(9, static_cast<std::uint64_t>(i));
            const Hit first = surface.closest_hit({*scene.viewpoint, random_direction(rng)});
            if (!first) {
                ++escaped;
                return;
            }
            const SurfacePoint x = surface.point(first);
            const float u = rng.uniform(), v = rng.uniform();
            const Vec3 onwards = Frame(x.normal).to_world(sample_cosine({u, v}));
            if (!surface.closest_hit({surface.lifted(x), onwards})) ++escaped;
        });
        EXPECT_EQ(escaped, 0) << name;
    }
}

/// A closed cube of n x n x 2 triangles a face, blown up to a ball where `round`; off the origin.
Scene closed_shell(int n, bool round) {
    Scene scene;
    scene.materials.push_back({"white", Rgb::Ones(), no_index});
    for (int face = 0; face < 6; ++face) {
        const auto first = static_cast<std::uint32_t>(scene.positions.size());
        const auto row = static_cast<std::uint32_t>(n) + 1;
        for (int y = 0; y <= n; ++y)
            for (int x = 0; x <= n; ++x) {
                Vec3 p;
                p[face / 2] = face % 2 ? 1.0f : -1.0f;
                p[(face / 2 + 1) % 3] = 2.0f * static_cast<float>(x) / static_cast<float>(n) - 1.0f;
                p[(face / 2 + 2) % 3] = 2.0f * static_cast<float>(y) / static_cast<float>(n) - 1.0f;
                if (round) p.normalize();
                scene.positions.push_back(3.7f * p + Vec3(5.3f, 1.1f, -7.7f));
            }
        for (std::uint32_t q = 0; q < row * row - row; ++q) {
            if (q % row == row - 1) continue;
            scene.triangles.push_back({first + q, first + q + 1, first + q + row + 1});
            scene.triangles.push_back({first + q, first + q + row + 1, first + q + row});
        }
    }
    scene.material_index.resize(scene.triangles.size());
    return scene;
}

/// At a place along a triangle's first edge: 0 is its corner.
Ray ray_to_an_edge(const Scene& scene, std::size_t triangle, const Vec3& from, float along) {
    const Triangle& t = scene.triangles[triangle];
    const Vec3 at = (1.0f - along) * scene.positions[t[0]] + along * scene.positions[t[1]];
    return {from, (at - from).normalized()};
}

TEST(Surface, LetsNoRaySlipThroughBetweenTwoTriangles) {
    for (const bool round : {false, true}) {
        const Scene scene = closed_shell(60, round);
        const Surface surface(scene);
        std::atomic<int> escaped = 0;
        // At edges and corners, where rounding decides.
        parallel_for(200'000, [&](Index i) {
            Rng rng(11, static_cast<std::uint64_t>(i));
            const Vec3 from = Vec3(5.3f, 1.1f, -7.7f) + 1.9f * random_point(rng);
            const std::size_t triangle = rng.next() % scene.triangles.size();
            const Ray ray = ray_to_an_edge(scene, triangle, from, i % 4 == 0 ? 0.0f : rng.uniform());
            escaped += !surface.closest_hit(ray);
            escaped += !surface.occluded(ray);
        });
        EXPECT_EQ(escaped, 0);
    }
}

TEST(Surface, LetsNoRayOfAPacketSlipThroughBetweenTwoTriangles) {
    for (const bool coherent : {false, true}) {
        const Scene scene = closed_shell(60, true);
        const Surface surface(scene);
        std::atomic<int> escaped = 0;
        parallel_for(50'000, [&](Index i) {
            Rng rng(12, static_cast<std::uint64_t>(i));
            const Vec3 from = Vec3(5.3f, 1.1f, -7.7f) + 1.9f * random_point(rng);
            std::array<Ray, 8> rays;
            std::array<Hit, 8> hits;
            const std::size_t first = rng.next() % (scene.triangles.size() - rays.size());
            for (std::size_t k = 0; k < rays.size(); ++k) // triangles side by side, as in the gather
                rays[k] = ray_to_an_edge(scene, first + k, from, i % 4 == 0 ? 0.0f : rng.uniform());
            surface.closest_hits(rays, hits, coherent);
            for (const Hit& hit : hits) escaped += !hit;
        });
        EXPECT_EQ(escaped, 0);
    }
}

TEST(Surface, OfAnEmptySceneIsNeverMet) {
    const Scene scene;
    const Surface surface(scene);
    EXPECT_FALSE(surface.closest_hit({Vec3::Zero(), Vec3::UnitX()}));
    EXPECT_FALSE(surface.occluded({Vec3::Zero(), Vec3::UnitX()}));
}

} // namespace
} // namespace afterglow
