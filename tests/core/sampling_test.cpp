#include "core/sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

namespace afterglow {
namespace {

constexpr double pi = static_cast<double>(EIGEN_PI);

using PointOf = std::function<Vec2(std::uint32_t)>;

/// True where each elementary interval of area 2^-k holds exactly one of the 2^k points.
bool is_net(const PointOf& point, std::uint32_t first, int k) {
    const std::uint32_t count = 1u << k;
    for (int split = 0; split <= k; ++split) {
        std::vector<int> hits(count, 0);
        for (std::uint32_t i = 0; i < count; ++i) {
            const Vec2 p = point(first + i);
            const auto column = static_cast<std::uint32_t>(std::ldexp(p.x(), split));
            const auto row = static_cast<std::uint32_t>(std::ldexp(p.y(), k - split));
            if (++hits[(column << (k - split)) + row] > 1) return false;
        }
    }
    return true;
}

Vec2 plain_sobol(std::uint32_t i) {
    const auto bits = sobol2(i);
    return {unit_float(bits[0]), unit_float(bits[1])};
}

TEST(Sobol, StratifiesEveryAlignedBlock) {
    for (int k = 0; k <= 10; ++k)
        for (std::uint32_t block = 0; block < 4; ++block)
            EXPECT_TRUE(is_net(plain_sobol, block << k, k)) << "2^" << k << ", block " << block;
}

TEST(OwenScramble, KeepsTheStratification) {
    for (std::uint64_t seed = 0; seed < 8; ++seed)
        for (int k = 0; k <= 10; k += 2)
            EXPECT_TRUE(
                is_net([&](std::uint32_t i) { return scrambled_sobol2(i, seed); }, 5u << k, k))
                << "seed " << seed << ", 2^" << k;
}

TEST(OwenScramble, IsABijection) {
    std::vector<bool> seen(1u << 16, false);
    for (std::uint32_t i = 0; i < seen.size(); ++i) {
        // Distinct leading 16 bits stay distinct: each bit depends on those above it alone.
        const std::uint32_t bits = owen_scramble(i << 16, 0x1234567u) >> 16;
        ASSERT_FALSE(seen[bits]);
        seen[bits] = true;
    }
}

TEST(ShuffledSobol, StratifiesEveryAlignedBlock) {
    for (std::uint64_t seed = 0; seed < 4; ++seed)
        EXPECT_TRUE(is_net([&](std::uint32_t i) { return shuffled_sobol2(i, seed); }, 3u << 8, 8));
}

TEST(ShuffledSobol, HasUncorrelatedSeeds) {
    constexpr std::uint32_t count = 4096;
    double sum = 0.0;
    for (std::uint32_t i = 0; i < count; ++i)
        sum += (shuffled_sobol2(i, 1).x() - 0.5) * (shuffled_sobol2(i, 2).x() - 0.5);
    // Independent pairs would give a standard deviation of 1/12 / sqrt(count).
    EXPECT_LT(std::abs(sum / count), 5.0 / 12.0 / std::sqrt(double(count)));
}

TEST(Rng, GivesUniformNumbersInEveryStream) {
    // Mean and mean square over the first two numbers of many streams, within five standard errors.
    constexpr int streams = 100'000;
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < streams; ++i) {
        Rng rng(3, static_cast<std::uint64_t>(i));
        for (int k = 0; k < 2; ++k) {
            const double x = rng.uniform();
            ASSERT_GE(x, 0.0);
            ASSERT_LT(x, 1.0);
            sum += x;
            squares += x * x;
        }
    }
    const double n = 2.0 * streams;
    EXPECT_NEAR(sum / n, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / n));
    EXPECT_NEAR(squares / n, 1.0 / 3.0, 5.0 * std::sqrt(4.0 / 45.0 / n));
}

TEST(SpiralPoint, PutsEquallyManyOnEqualAreas) {
    constexpr int count = 1024, rings = 8, sectors = 8;
    std::array<int, rings * sectors> in{};
    for (int k = 0; k < count; ++k) {
        const Vec2 at = spiral_point(static_cast<float>(k) + 0.5f, count, 0.3f);
        const auto ring = std::min(rings - 1, static_cast<int>(rings * at.squaredNorm()));
        const auto turn = std::atan2(at.y(), at.x()) / (2.0f * static_cast<float>(EIGEN_PI)) + 0.5f;
        ++in[static_cast<std::size_t>(sectors * ring + std::min(sectors - 1, static_cast<int>(sectors * turn)))];
    }
    for (const int n : in) EXPECT_NEAR(n, count / (rings * sectors), 2);
    EXPECT_EQ(spiral_point(0.0f, 5), Vec2::Zero());
}

TEST(Frame, IsOrthonormalAndRightHanded) {
    Rng rng(5, 0);
    for (int i = 0; i < 10'000; ++i) {
        Vec3 n = sample_sphere({rng.uniform(), rng.uniform()});
        if (i == 0) n = {0, 0, -1};
        if (i == 1) n = {0, 0, 1};
        const Frame frame(n);
        Eigen::Matrix3f m;
        m << frame.x, frame.y, frame.z;
        ASSERT_LT((m.transpose() * m - Eigen::Matrix3f::Identity()).norm(), 1e-5f) << n.transpose();
        ASSERT_NEAR(m.determinant(), 1.0f, 1e-5f);
        ASSERT_EQ(frame.to_world(Vec3::UnitZ()), n);
    }
}

struct DirectionSampler {
    const char* name;
    Vec3 (*sample)(const Vec2&);
    double (*pdf)(double cos_theta); // per solid angle
    double lowest_cosine;            // 0: hemisphere, -1: sphere
};

const DirectionSampler samplers[] = {
    {"cosine", sample_cosine, [](double c) { return c / pi; }, 0.0},
    {"vector_irradiance", sample_vector_irradiance,
     [](double c) { return double(vector_irradiance_pdf(static_cast<float>(c))); }, 0.0},
    {"sphere", sample_sphere, [](double) { return 0.25 / pi; }, -1.0},
};

class DirectionSampling : public testing::TestWithParam<DirectionSampler> {};

/// Probability of cosines in [low, high], by the midpoint rule (exact for linear densities).
double probability(const DirectionSampler& sampler, double low, double high) {
    return 2.0 * pi * (high - low) * sampler.pdf(0.5 * (low + high));
}

TEST_P(DirectionSampling, HasADensityThatIntegratesToOne) {
    EXPECT_NEAR(probability(GetParam(), GetParam().lowest_cosine, 1.0), 1.0, 1e-6);
}

TEST_P(DirectionSampling, FollowsItsDensity) {
    // Pearson's chi-square over 16 x 8 cells in cosine and azimuth: mean 127, deviation 16.
    constexpr int rows = 16, columns = 8, count = 200'000;
    const DirectionSampler& sampler = GetParam();
    std::vector<int> observed(rows * columns, 0);
    Rng rng(11, 0);
    for (int i = 0; i < count; ++i) {
        const float u = rng.uniform(), v = rng.uniform();
        const Vec3 d = sampler.sample({u, v});
        ASSERT_NEAR(d.norm(), 1.0f, 1e-5f);
        ASSERT_GE(d.z(), sampler.lowest_cosine);
        const double row = rows * (d.z() - sampler.lowest_cosine) / (1.0 - sampler.lowest_cosine);
        const double turn = std::atan2(d.y(), d.x()) / (2.0 * pi);
        const double column = columns * (turn < 0.0 ? turn + 1.0 : turn);
        ++observed[static_cast<std::size_t>(std::min(int(row), rows - 1) * columns
                                            + std::min(int(column), columns - 1))];
    }
    double chi_square = 0.0;
    for (int r = 0; r < rows; ++r) {
        const double low = sampler.lowest_cosine, step = (1.0 - low) / rows;
        const double expected =
            count * probability(sampler, low + r * step, low + (r + 1) * step) / columns;
        for (int c = 0; c < columns; ++c)
            chi_square +=
                std::pow(observed[static_cast<std::size_t>(r * columns + c)] - expected, 2)
                / expected;
    }
    EXPECT_LT(chi_square, 127.0 + 5.0 * 16.0);
}

TEST_P(DirectionSampling, EstimatesTheIrradianceOfUniformLight) {
    // Under radiance 1 from everywhere above, the cosine integrates to pi; below it counts nothing.
    constexpr std::uint32_t count = 1 << 14;
    const DirectionSampler& sampler = GetParam();
    double sum = 0.0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vec3 d = sampler.sample(scrambled_sobol2(i, 1));
        if (d.z() > 0.0f) sum += d.z() / sampler.pdf(d.z());
    }
    EXPECT_NEAR(sum / count, pi, 1e-3); // stratified in d.z: error O(1/count)
}

TEST_P(DirectionSampling, IsSafeAtTheEndsOfTheUnitSquare) {
    for (const float u : {0.0f, one_minus_epsilon})
        for (const float v : {0.0f, one_minus_epsilon}) {
            const Vec3 d = GetParam().sample({u, v});
            EXPECT_TRUE(d.allFinite());
            EXPECT_NEAR(d.norm(), 1.0f, 1e-5f);
        }
}

INSTANTIATE_TEST_SUITE_P(All, DirectionSampling, testing::ValuesIn(samplers),
                         [](const auto& one) { return one.param.name; });

} // namespace
} // namespace afterglow
