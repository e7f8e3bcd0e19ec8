#include "basis/r_tree.h"
#include "core/sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

namespace afterglow {
namespace {

struct Spheres {
    Eigen::Matrix3Xf center;
    Eigen::VectorXf radius;
};

Vec3 random_place(Rng& rng) {
    const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
    return {x, y, z};
}

Spheres uniform_spheres(int count, float largest_radius, std::uint64_t seed) {
    Rng rng(seed, 0);
    Spheres s{Eigen::Matrix3Xf(3, count), Eigen::VectorXf(count)};
    for (int i = 0; i < count; ++i) {
        s.center.col(i) = random_place(rng);
        s.radius[i] = largest_radius * rng.uniform();
    }
    return s;
}

/// Tight heaps of spheres far apart, some centres repeated.
Spheres clustered_spheres(int count, std::uint64_t seed) {
    Rng rng(seed, 0);
    Spheres s{Eigen::Matrix3Xf(3, count), Eigen::VectorXf(count)};
    Vec3 heap = random_place(rng);
    for (int i = 0; i < count; ++i) {
        if (i % 100 == 0) heap = random_place(rng);
        const Vec3 beside = heap + 0.01f * random_place(rng);
        s.center.col(i) = i % 7 == 0 ? heap : beside;
        s.radius[i] = 0.01f * rng.uniform();
    }
    return s;
}

/// Radii of zero, of the smallest numbers and far beyond the box.
Spheres odd_spheres(int count, std::uint64_t seed) {
    Spheres s = uniform_spheres(count, 0.2f, seed);
    const float radius[] = {0.0f, 1e-30f, 1e-6f, 100.0f};
    for (int i = 0; i < count; ++i)
        if (i % 5 < 4) s.radius[i] = radius[i % 5];
    return s;
}

/// Compares with every sphere one by one; those whose surface passes within rounding of x may be
/// found or not.
void expect_same_as_brute_force(const Spheres& spheres, int queries, const std::string& what) {
    constexpr std::uint32_t first_id = 1000;
    const RTree tree(spheres.center, spheres.radius, first_id);
    Rng rng(99, 0);
    for (int q = 0; q < queries; ++q) {
        Vec3 x = 1.2f * random_place(rng) - Vec3::Constant(0.1f);
        // Half of the queries close to a sphere, where clusters are.
        if (q % 2 && spheres.center.cols() > 0) {
            const auto near = static_cast<Index>(rng.next() % spheres.center.cols());
            x = spheres.center.col(near)
                + 2.0f * spheres.radius[near] * (random_place(rng) - Vec3::Constant(0.5f));
        }
        std::map<std::uint32_t, float> found;
        tree.containing(x, [&](std::uint32_t id, float distance2) {
            EXPECT_TRUE(found.emplace(id, distance2).second) << what << ": reported twice";
        });
        for (Index i = 0; i < spheres.center.cols(); ++i) {
            const double distance2 =
                (spheres.center.col(i).cast<double>() - x.cast<double>()).squaredNorm();
            const double radius2 = std::pow(static_cast<double>(spheres.radius[i]), 2);
            const auto at = found.find(first_id + static_cast<std::uint32_t>(i));
            const double rounding = 1e-6 * (radius2 + distance2) + 1e-13;
            if (distance2 < radius2 - rounding) {
                ASSERT_NE(at, found.end()) << what << ": misses sphere " << i;
            } else if (distance2 >= radius2 + rounding || radius2 == 0.0) {
                ASSERT_EQ(at, found.end()) << what << ": does not contain x, sphere " << i;
            }
            if (at == found.end()) continue;
            EXPECT_NEAR(at->second, distance2, rounding) << what;
            found.erase(at);
        }
        ASSERT_TRUE(found.empty()) << what << ": unknown id " << found.begin()->first;
    }
}

TEST(RTree, FindsTheSpheresThatBruteForceFinds) {
    expect_same_as_brute_force(uniform_spheres(2000, 0.1f, 1), 3000, "uniform");
    expect_same_as_brute_force(uniform_spheres(2000, 2.0f, 2), 300, "overlapping");
    expect_same_as_brute_force(clustered_spheres(2000, 3), 3000, "clustered");
    expect_same_as_brute_force(odd_spheres(1000, 4), 2000, "odd radii");
}

TEST(RTree, AnswersForEveryNumberOfSpheresAroundItsWidth) {
    for (const int count : {0, 1, 2, 7, 8, 9, 15, 63, 64, 65, 512, 513})
        expect_same_as_brute_force(uniform_spheres(count, 0.5f, 5), 200,
                                   std::to_string(count) + " spheres");
}

TEST(RTree, FindsWithinAReachWhatContainsXWhenItGrowsByIt) {
    const Spheres spheres = uniform_spheres(2000, 0.1f, 6);
    const RTree tree(spheres.center, spheres.radius, 0);
    Rng rng(7, 0);
    for (const float reach : {0.0f, 0.01f, 0.3f}) {
        const RTree grown(spheres.center, spheres.radius.array() + reach, 0);
        for (int q = 0; q < 300; ++q) {
            const Vec3 x = random_place(rng);
            std::set<std::uint32_t> found, expected;
            // Rounding decides where the surface of a sphere passes through x.
            const auto unclear = [&](std::uint32_t i) {
                return std::abs((spheres.center.col(i) - x).norm() - spheres.radius[i] - reach) < 1e-6f;
            };
            tree.within(x, reach, [&](std::uint32_t i, float distance2) {
                EXPECT_NEAR(distance2, (spheres.center.col(i) - x).squaredNorm(), 1e-6f);
                if (!unclear(i)) found.insert(i);
            });
            grown.containing(x, [&](std::uint32_t i, float) {
                if (!unclear(i)) expected.insert(i);
            });
            ASSERT_EQ(found, expected) << "reach " << reach;
        }
    }
}

TEST(RTree, ContainsNothingWhenItIsEmpty) {
    const auto expect_nothing = [](const RTree& tree) {
        int visits = 0;
        tree.containing(Vec3::Zero(), [&](std::uint32_t, float) { ++visits; });
        EXPECT_EQ(visits, 0);
        EXPECT_EQ(tree.node_count(), 0u);
    };
    expect_nothing(RTree());
    expect_nothing(RTree(Eigen::Matrix3Xf(3, 0), Eigen::VectorXf(0), 0));
}

TEST(RTree, FindsAThousandSpheresInOnePlace) {
    Spheres s{Eigen::Matrix3Xf::Constant(3, 1000, 0.5f), Eigen::VectorXf::Constant(1000, 0.1f)};
    expect_same_as_brute_force(s, 50, "one place");
}

TEST(RTree, HasAnOuterSurfaceThatIsNotContained) {
    // |x - c| = r exactly: a kernel is zero there.
    const Eigen::Matrix3Xf center = Eigen::Matrix3Xf::Zero(3, 1);
    const RTree tree(center, Eigen::VectorXf::Constant(1, 0.5f), 0);
    int visits = 0;
    tree.containing({0.5f, 0, 0}, [&](std::uint32_t, float) { ++visits; });
    EXPECT_EQ(visits, 0);
    tree.containing({std::nextafter(0.5f, 0.0f), 0, 0}, [&](std::uint32_t, float) { ++visits; });
    EXPECT_EQ(visits, 1);
}

} // namespace
} // namespace afterglow
