#include "basis/nearest_points.h"
#include "core/sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace afterglow {
namespace {

Eigen::Matrix3Xf random_points(int count, std::uint64_t seed) {
    Rng rng(seed, 0);
    return Eigen::Matrix3Xf::NullaryExpr(3, count, [&] { return rng.uniform(); });
}

TEST(NearestPoints, AreThoseThatBruteForceFinds) {
    const Eigen::Matrix3Xf points = random_points(700, 1);
    const NearestPoints nearest(points);
    const Eigen::Matrix3Xf queries = 1.4f * random_points(500, 2).array() - 0.2f;
    std::vector<std::uint32_t> found;
    for (Index q = 0; q < queries.cols(); ++q) {
        const Eigen::VectorXf distance = (points.colwise() - queries.col(q)).colwise().norm();
        std::vector<std::uint32_t> order(700);
        std::iota(order.begin(), order.end(), 0u);
        std::sort(order.begin(), order.end(),
                  [&](std::uint32_t a, std::uint32_t b) { return distance[a] < distance[b]; });
        for (const int count : {1, 7, 32}) {
            nearest.closest(queries.col(q), count, found);
            ASSERT_EQ(found.size(), static_cast<std::size_t>(count));
            for (int k = 0; k < count; ++k)
                EXPECT_NEAR(distance[found[k]], distance[order[k]], 1e-6f);
            std::sort(found.begin(), found.end());
            EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
        }
    }
}

TEST(NearestPoints, AreAllPointsWhereFewerAreThere) {
    std::vector<std::uint32_t> found{9, 9, 9};
    for (const int count : {0, 1, 5}) {
        const NearestPoints nearest(random_points(count, 3));
        nearest.closest(Vec3::Zero(), 8, found);
        EXPECT_EQ(found.size(), static_cast<std::size_t>(count));
    }
}

} // namespace
} // namespace afterglow
