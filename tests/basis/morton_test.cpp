#include "basis/morton.h"
#include "core/sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace afterglow {
namespace {

std::vector<Vec3> random_positions(int count, std::uint64_t seed) {
    Rng rng(seed, 0);
    std::vector<Vec3> positions;
    for (int i = 0; i < count; ++i) {
        const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
        positions.push_back({x, y, z});
    }
    return positions;
}

/// Which of two cells of a grid comes first on the Z curve: the coordinate whose highest differing
/// bit is highest decides; of equal ones the later axis.
bool before_on_z_curve(const std::array<std::uint32_t, 3>& a,
                       const std::array<std::uint32_t, 3>& b) {
    int deciding = 0;
    std::uint32_t most = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const std::uint32_t differs = a[axis] ^ b[axis];
        if (std::bit_floor(differs) >= std::bit_floor(most) && differs != 0) {
            deciding = axis;
            most = differs;
        }
    }
    return a[deciding] < b[deciding];
}

TEST(MortonOrder, IsAPermutation) {
    for (const int count : {0, 1, 2, 1000}) {
        std::vector<std::uint32_t> order = morton_order(random_positions(count, 1));
        std::sort(order.begin(), order.end());
        std::vector<std::uint32_t> all(static_cast<std::size_t>(count));
        std::iota(all.begin(), all.end(), 0u);
        EXPECT_EQ(order, all);
    }
}

TEST(MortonOrder, FollowsTheZCurveOnAGrid) {
    // A shuffled 8 x 8 x 8 grid: each of its cells is a cell of the curve's as well.
    std::vector<std::array<std::uint32_t, 3>> cells;
    for (std::uint32_t i = 0; i < 512; ++i)
        cells.push_back({i % 8, i / 8 % 8, i / 64});
    std::sort(cells.begin(), cells.end(), [](const auto& a, const auto& b) {
        return hash64(a[0] + 8 * a[1] + 64 * a[2]) < hash64(b[0] + 8 * b[1] + 64 * b[2]);
    });
    std::vector<Vec3> positions;
    for (const auto& c : cells)
        positions.push_back(Vec3(c[0] * 8.0f / 7.0f, c[1] * 8.0f / 7.0f, c[2] * 8.0f / 7.0f));
    const std::vector<std::uint32_t> order = morton_order(positions);
    for (std::size_t k = 0; k + 1 < order.size(); ++k)
        EXPECT_TRUE(before_on_z_curve(cells[order[k]], cells[order[k + 1]])) << "place " << k;
}

TEST(MortonOrder, PutsNeighboursNearEachOther) {
    const std::vector<Vec3> positions = random_positions(4096, 2);
    const std::vector<std::uint32_t> order = morton_order(positions);
    double along_curve = 0.0, as_given = 0.0;
    for (std::size_t k = 0; k + 1 < order.size(); ++k) {
        along_curve += (positions[order[k]] - positions[order[k + 1]]).norm();
        as_given += (positions[k] - positions[k + 1]).norm();
    }
    // Random points of a unit cube are .66 apart; 4096 of them have a neighbour within about .04.
    EXPECT_LT(along_curve, 0.15 * as_given);
}

TEST(MortonOrder, BreaksTiesById) {
    const std::vector<Vec3> positions(20, Vec3(1, 2, 3));
    const std::vector<std::uint32_t> order = morton_order(positions);
    EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
}

} // namespace
} // namespace afterglow
