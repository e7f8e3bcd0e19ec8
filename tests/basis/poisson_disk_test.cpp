#include "basis/poisson_disk.h"
#include "core/builtin_scenes.h"
#include "core/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace afterglow {
namespace {

/// D(x, y) = min(d_x(y), d_y(x)) / max(0, n_x . n_y)^power in double precision.
double placement_distance(const SurfacePoint& x, const SurfacePoint& y, int power) {
    const Eigen::Vector3d offset = x.position.cast<double>() - y.position.cast<double>();
    const Eigen::Vector3d nx = x.normal.cast<double>(), ny = y.normal.cast<double>();
    if (nx.dot(ny) <= 0.0) return std::numeric_limits<double>::infinity();
    const double hx = offset.dot(nx), hy = offset.dot(ny);
    const double from_x = offset.squaredNorm() + 8.0 * hx * hx;
    const double from_y = offset.squaredNorm() + 8.0 * hy * hy;
    return std::sqrt(std::min(from_x, from_y)) / std::pow(nx.dot(ny), power);
}

double gap_by_brute_force(const PoissonDisk& disk, const SurfacePoint& x, int power) {
    double closest = std::numeric_limits<double>::infinity();
    for (const Candidate& c : disk.points)
        closest = std::min(closest, placement_distance(x, c.at, power));
    return closest;
}

struct Case {
    const char* scene;
    float spacing;
    int power;
};
const Case cases[] = {{"builtin:cornell", 0.03f, 16},
                      {"builtin:two_rooms", 0.3f, 16},
                      {"builtin:sphere:0.5", 0.15f, 16},
                      {"builtin:sphere:0.5", 0.14f, 2}};

TEST(PoissonDisk, KeepsItsPointsApart) {
    for (const Case& c : cases) {
        const Scene scene = make_builtin_scene(c.scene);
        const Surface surface(scene);
        CandidateSource source(surface, {*scene.viewpoint}, 2);
        const PoissonDisk disk = poisson_disk(source, {.spacing = c.spacing,
                                                       .placement_power = c.power,
                                                       .candidates_per_point = 1000});
        ASSERT_GT(disk.points.size(), 400u) << c.scene;
        EXPECT_TRUE(disk.openness.empty());
        double closest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < disk.points.size(); ++i)
            for (std::size_t j = 0; j < i; ++j)
                closest = std::min(
                    closest, placement_distance(disk.points[i].at, disk.points[j].at, c.power));
        EXPECT_GT(closest, 0.9999 * c.spacing) << c.scene;
        // A set that is needlessly thin would show here: it has pairs just beyond R.
        EXPECT_LT(closest, 1.05 * c.spacing) << c.scene;
    }
}

TEST(PoissonDisk, LeavesAsFewHolesAsAsked) {
    // Holes are no more than the share of the last round that fitted: that is at least 2048 candidates, of
    // which fewer than one in 1000 or 48 did. Five standard errors of both counts are added.
    for (const Case& c : cases)
        for (const int candidates_per_point : {1000, 48}) {
            const Scene scene = make_builtin_scene(c.scene);
            const Surface surface(scene);
            CandidateSource source(surface, {*scene.viewpoint}, 2);
            const PoissonDisk disk = poisson_disk(source, {.spacing = c.spacing,
                                                           .placement_power = c.power,
                                                           .candidates_per_point = candidates_per_point});
            const std::size_t fresh = 10'000, first = disk.candidates_tried;
            source.ensure(first + fresh);
            int holes = 0;
            for (std::size_t i = first; i < first + fresh; ++i)
                holes += gap_by_brute_force(disk, source[i].at, c.power) >= c.spacing;
            const double share = 1.0 / candidates_per_point;
            EXPECT_LE(holes, fresh * share + 5.0 * std::sqrt(fresh * share * (1.0 + fresh / 2048.0)))
                << c.scene << ", " << candidates_per_point;
            EXPECT_GT(holes, candidates_per_point == 48 ? 20 : -1) << c.scene;
        }
}

/// Of so many fresh candidates that are asked for, how many are 1.1 R from all points.
template <class Asked>
int deep_in_holes(const PoissonDisk& disk, CandidateSource& source, float spacing, int fresh, const Asked& asked) {
    int found = 0, deep = 0;
    for (std::size_t i = disk.candidates_tried; found < fresh; ++i) {
        source.ensure(i + 1);
        const SurfacePoint& x = source[i].at;
        if (!asked(x)) continue;
        ++found;
        deep += gap_by_brute_force(disk, x, PoissonDiskOptions{}.placement_power) > 1.1 * spacing;
    }
    return deep;
}

// A feature never differs by this much: darts conflict as where there is none.
constexpr float no_density = 10.0f;

TEST(PoissonDisk, FillsItsHolesWherePlacedByOpenness) {
    // A hole is missed only where none of eight directions from the darts around meets it, or where no
    // darts are around.
    for (const Case& c : {cases[0], cases[1], cases[2]}) {
        const Scene scene = make_builtin_scene(c.scene);
        const Surface surface(scene);
        CandidateSource source(surface, {*scene.viewpoint}, 2);
        const auto deep = [&](float density) {
            const PoissonDisk disk
                = poisson_disk(source, {.spacing = c.spacing, .openness_density = density});
            return deep_in_holes(disk, source, c.spacing, 10'000, [](const SurfacePoint&) { return true; });
        };
        const int with_holes = deep(0.0f);
        EXPECT_GT(with_holes, 20) << c.scene;
        EXPECT_LT(deep(no_density), with_holes / 2) << c.scene;
        EXPECT_LT(deep(0.15f), with_holes / 4) << c.scene;
    }
}

TEST(PoissonDisk, FillsItsHolesWhereOnlyTheVoidLooksAt) {
    // The boxes' sides towards the opening, of which particles from inside see little.
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    CandidateSource source(surface, {*scene.viewpoint}, 2);
    constexpr float spacing = 0.02f;
    const auto deep = [&](float density) {
        const PoissonDisk disk = poisson_disk(source, {.spacing = spacing, .openness_density = density});
        return deep_in_holes(disk, source, spacing, 2000, [](const SurfacePoint& x) {
            return x.normal.z() < -0.9f && x.position.z() < 0.5f;
        });
    };
    const int with_holes = deep(0.0f);
    EXPECT_GT(with_holes, 30);
    EXPECT_LT(deep(no_density), with_holes / 10);
}

TEST(PoissonDisk, LeavesOutNarrowPlacesWhereAsked) {
    // At a distance h from a cube's edge, h much smaller than R, the mean of 1 / distance over
    // cosine-distributed directions is 2 / (3 pi h): narrow where h < R / 28. Sixteen rays measure
    // that to a third.
    const Scene scene = make_builtin_scene("builtin:furnace");
    const Surface surface(scene);
    constexpr float spacing = 0.15f;
    const auto in_edges = [&](bool skip_narrow) {
        CandidateSource source(surface, {Vec3::Zero()}, 3);
        const PoissonDisk disk =
            poisson_disk(source, {.spacing = spacing, .skip_narrow = skip_narrow});
        int count = 0;
        for (const Candidate& c : disk.points) {
            Vec3 side = c.at.position.cwiseAbs();
            std::sort(side.data(), side.data() + 3);
            count += 1.0f - side[1] < 0.6f * spacing / 28.0f;
        }
        return count;
    };
    EXPECT_EQ(in_edges(true), 0);
    EXPECT_GT(in_edges(false), 3);
}

TEST(PoissonDisk, CrowdsWhereTheOpennessChangesAndNowhereElse) {
    for (const char* name : {"builtin:cornell", "builtin:two_rooms"}) {
        const Scene scene = make_builtin_scene(name);
        const Surface surface(scene);
        const float spacing = name == std::string("builtin:cornell") ? 0.04f : 0.4f;
        constexpr double s = 0.1;
        CandidateSource source(surface, {*scene.viewpoint}, 4);
        const PoissonDisk plain = poisson_disk(source, {.spacing = spacing});
        const PoissonDisk disk =
            poisson_disk(source, {.spacing = spacing, .openness_density = static_cast<float>(s)});
        EXPECT_GT(disk.points.size(), 1.2 * plain.points.size());
        ASSERT_EQ(disk.openness.size(), disk.points.size());
        double closest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < disk.points.size(); ++i)
            for (std::size_t j = 0; j < i; ++j) {
                const double d = placement_distance(disk.points[i].at, disk.points[j].at, 16);
                if (d >= spacing) continue;
                closest = std::min(closest, d);
                const double difference2 = openness_difference2(disk.openness[i], disk.openness[j]);
                EXPECT_GT(d * std::exp(difference2 / (2.0 * s * s)), 0.9999 * spacing) << name;
            }
        EXPECT_GT(closest, 0.9999 * spacing / 32.0) << name;
        // The features are those of the points.
        const OpennessProbe probe(surface, spacing);
        for (std::size_t i = 0; i < disk.points.size(); i += 50)
            EXPECT_LT(openness_difference2(disk.openness[i], probe(disk.points[i].at)), 1e-6f);
    }
}

bool equal(const PoissonDisk& a, const PoissonDisk& b) {
    if (a.points.size() != b.points.size() || a.candidates_tried != b.candidates_tried
        || a.openness.size() != b.openness.size())
        return false;
    for (std::size_t i = 0; i < a.points.size(); ++i)
        if (a.points[i].at.position != b.points[i].at.position) return false;
    for (std::size_t i = 0; i < a.openness.size(); ++i)
        if (a.openness[i] != b.openness[i]) return false;
    return true;
}

TEST(PoissonDisk, DependsOnTheSeedButNotOnThreads) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const auto make = [&](int threads, std::uint64_t seed, float density) {
        const ThreadLimit limit(threads);
        CandidateSource source(surface, {*scene.viewpoint}, seed);
        return poisson_disk(source, {.spacing = 0.05f, .openness_density = density});
    };
    for (const float density : {0.0f, 0.1f}) {
        const PoissonDisk one = make(1, 7, density);
        EXPECT_TRUE(equal(one, make(2, 7, density)));
        EXPECT_TRUE(equal(one, make(2, 7, density)));
        EXPECT_FALSE(equal(one, make(1, 8, density)));
    }
}

} // namespace
} // namespace afterglow
