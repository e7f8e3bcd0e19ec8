#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/krylov.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

using Apply = std::function<std::vector<float>(const std::vector<float>&)>;

/// |m^n|^(1/n) for n = 4096, more than the largest eigenvalue by a thousandth at most.
double spectral_radius(Eigen::MatrixXd m) {
    double log_radius = 0.0;
    for (double n = 1.0; n <= 4096.0; n *= 2.0) {
        const double size = m.norm();
        log_radius += std::log(size) / n;
        m /= size;
        m = (m * m).eval();
    }
    return std::exp(log_radius);
}

/// The largest singular value, from below.
double spectral_norm(const Eigen::MatrixXd& m) {
    Eigen::VectorXd v = Eigen::VectorXd::Ones(m.cols());
    for (int k = 0; k < 200; ++k) v = (m.transpose() * (m * v)).normalized();
    return (m * v).norm();
}

/// A random matrix scaled to a spectral radius, not symmetric: light does not bounce symmetrically.
Eigen::MatrixXd random_contraction(int size, double radius, std::uint64_t seed, bool positive) {
    Rng rng(seed, 0);
    Eigen::MatrixXd m = Eigen::MatrixXd::NullaryExpr(
        size, size, [&] { return rng.uniform() - (positive ? 0.0 : 0.5); });
    return m * (radius / spectral_radius(m));
}

/// One matrix a channel, channels interleaved.
Apply multiplication(const std::vector<Eigen::MatrixXd>& matrix) {
    return [&matrix](const std::vector<float>& f) {
        const auto channels = matrix.size();
        std::vector<float> result(f.size());
        for (std::size_t c = 0; c < channels; ++c)
            for (Index i = 0; i < matrix[c].rows(); ++i) {
                double sum = 0.0;
                for (Index j = 0; j < matrix[c].cols(); ++j)
                    sum += matrix[c](i, j) * f[static_cast<std::size_t>(j) * channels + c];
                result[static_cast<std::size_t>(i) * channels + c] = static_cast<float>(sum);
            }
        return result;
    };
}

std::vector<float> random_light(std::size_t count, std::uint64_t seed) {
    Rng rng(seed, 0);
    std::vector<float> light(count);
    for (float& l : light)
        l = rng.uniform();
    return light;
}

Eigen::VectorXd channel_of(const std::vector<float>& values, int c, int channels) {
    Eigen::VectorXd v(static_cast<Index>(values.size()) / channels);
    for (Index i = 0; i < v.size(); ++i)
        v[i] = values[static_cast<std::size_t>(i * channels + c)];
    return v;
}

TEST(SolveSecondKind, AgreesWithLuDecomposition) {
    constexpr int size = 150;
    for (const bool positive : {false, true})
        for (const double radius : {0.3, 0.7, 0.95}) {
            std::vector<Eigen::MatrixXd> matrix;
            for (std::uint64_t c = 0; c < 3; ++c)
                matrix.push_back(
                    random_contraction(size, radius * (1.0 - 0.3 * c), 10 + c, positive));
            const std::vector<float> b = random_light(3 * size, 2);
            const double tolerance = 1e-4;
            const KrylovResult result = solve_second_kind(multiplication(matrix), b, 3, tolerance);
            EXPECT_LE(result.residual, tolerance);
            for (int c = 0; c < 3; ++c) {
                const Eigen::MatrixXd system = Eigen::MatrixXd::Identity(size, size) - matrix[c];
                const Eigen::VectorXd rhs = channel_of(b, c, 3);
                const Eigen::VectorXd exact = system.lu().solve(rhs);
                const Eigen::VectorXd solution = channel_of(result.solution, c, 3);
                const double first_bounce = (matrix[c] * rhs).norm();
                // What the header promises, measured anew, and what follows for the solution.
                EXPECT_LE((rhs - system * solution).norm(), (tolerance + 1e-5) * first_bounce);
                const double gain = spectral_norm(system.inverse());
                EXPECT_LE((solution - exact).norm(), (tolerance + 1e-5) * first_bounce * gain);
            }
        }
}

TEST(SolveSecondKind, IsTheSumOfAHundredBouncesAndMore) {
    // At a spectral radius of .95 a hundred bounces leave .95^101 = .6 % of the series' sum.
    constexpr int size = 200;
    const std::vector<Eigen::MatrixXd> matrix{random_contraction(size, 0.95, 3, true)};
    const Apply apply = multiplication(matrix);
    const std::vector<float> b = random_light(size, 4);
    std::vector<float> sum = b, bounce = b;
    double left = 0.0;
    for (int k = 0; k < 600; ++k) {
        bounce = apply(bounce);
        for (std::size_t i = 0; i < sum.size(); ++i)
            sum[i] += bounce[i];
        if (k == 99) left = (channel_of(bounce, 0, 1).norm()) / channel_of(sum, 0, 1).norm();
    }
    EXPECT_LT(left, 0.001);
    const KrylovResult result = solve_second_kind(apply, b, 1, 1e-5);
    // A positive random matrix has one large eigenvalue: a few products do.
    EXPECT_LT(result.products, 15);
    EXPECT_LT((channel_of(result.solution, 0, 1) - channel_of(sum, 0, 1)).norm(),
              1e-4 * channel_of(sum, 0, 1).norm());
}

TEST(SolveSecondKind, SolvesEachChannelAsIfAlone) {
    constexpr int size = 80;
    std::vector<Eigen::MatrixXd> matrix;
    for (std::uint64_t c = 0; c < 3; ++c)
        matrix.push_back(random_contraction(size, 0.3 + 0.3 * c, 20 + c, c == 1));
    const std::vector<float> b = random_light(3 * size, 5);
    const KrylovResult together = solve_second_kind(multiplication(matrix), b, 3, 1e-5);
    for (int c = 0; c < 3; ++c) {
        const std::vector<Eigen::MatrixXd> one{matrix[c]};
        const Eigen::VectorXf alone_b = channel_of(b, c, 3).cast<float>();
        const KrylovResult alone = solve_second_kind(
            multiplication(one), {alone_b.data(), alone_b.data() + size}, 1, 1e-5);
        EXPECT_LE(alone.products, together.products);
        EXPECT_LT((channel_of(together.solution, c, 3) - channel_of(alone.solution, 0, 1)).norm(),
                  1e-4 * channel_of(alone.solution, 0, 1).norm());
    }
}

TEST(SolveSecondKind, GoesOnWhereAChannelIsDarkOrDone) {
    // Channel 0 is dark, 1 an eigenvector (done after one product), 2 needs many.
    constexpr int size = 60;
    std::vector<Eigen::MatrixXd> matrix{random_contraction(size, 0.9, 30, false),
                                        0.5 * Eigen::MatrixXd::Identity(size, size),
                                        random_contraction(size, 0.9, 31, false)};
    std::vector<float> b = random_light(3 * size, 6);
    for (int i = 0; i < size; ++i)
        b[3 * i] = 0.0f;
    const KrylovResult result = solve_second_kind(multiplication(matrix), b, 3, 1e-4);
    EXPECT_LE(result.residual, 1e-4);
    EXPECT_GT(result.products, 5);
    EXPECT_EQ(channel_of(result.solution, 0, 3).norm(), 0.0);
    EXPECT_LT((channel_of(result.solution, 1, 3) - 2.0 * channel_of(b, 1, 3)).norm(),
              1e-4 * channel_of(b, 1, 3).norm());
    const Eigen::VectorXd exact =
        (Eigen::MatrixXd::Identity(size, size) - matrix[2]).lu().solve(channel_of(b, 2, 3));
    EXPECT_LT((channel_of(result.solution, 2, 3) - exact).norm(), 2e-3 * exact.norm());
}

// A colour whose light dies after few bounces, as between red walls among blue ones, while the others need many.
TEST(SolveSecondKind, KeepsAChannelThatIsDoneBeforeTheOthers) {
    constexpr int size = 300;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Rng rng(seed, 1);
        Eigen::MatrixXd dying = Eigen::MatrixXd::Zero(size, size); // onto a few, which return nothing, or next to nothing
        for (int i = 0; i < 4; ++i)
            for (int j = 4; j < size; ++j) {
                dying(i, j) = rng.uniform() * 0.9 / size;
                dying(j, i) = seed % 2 == 0 ? 0.0 : 1e-7 * rng.uniform();
            }
        const std::vector<Eigen::MatrixXd> matrix{dying, random_contraction(size, 0.9, 40 + seed, true),
                                                  random_contraction(size, 0.7, 70 + seed, false)};
        const std::vector<float> b = random_light(3 * size, 100 + seed);
        for (const double tolerance : {2e-2, 2e-3, 1e-4}) {
            const KrylovResult result = solve_second_kind(multiplication(matrix), b, 3, tolerance);
            EXPECT_LE(result.residual, tolerance);
            EXPECT_GT(result.products, 4);
            for (int c = 0; c < 3; ++c) {
                const Eigen::VectorXd rhs = channel_of(b, c, 3), solution = channel_of(result.solution, c, 3);
                EXPECT_LE((rhs - solution + matrix[c] * solution).norm(), (tolerance + 1e-5) * (matrix[c] * rhs).norm())
                    << "channel " << c << ", seed " << seed;
            }
        }
    }
}

TEST(SolveSecondKind, LeavesLightThatNeverBouncesAlone) {
    const Apply nothing = [](const std::vector<float>& f) { return std::vector<float>(f.size()); };
    const std::vector<float> b = random_light(30, 7);
    const KrylovResult result = solve_second_kind(nothing, b, 3, 1e-3);
    EXPECT_EQ(result.solution, b);
    EXPECT_EQ(result.products, 1);
    EXPECT_EQ(result.residual, 0.0);
}

TEST(SolveSecondKind, ReportsAResidualThatItCouldNotReach) {
    // A rotation in every plane pair, |eigenvalues| = 1: sixty products are not enough for 1e-6.
    constexpr int size = 400;
    const Apply shift = [](const std::vector<float>& f) {
        std::vector<float> g(f.size());
        for (std::size_t i = 0; i < f.size(); ++i)
            g[(i + 1) % f.size()] = 0.9999f * f[i];
        return g;
    };
    std::vector<float> b(size, 0.0f);
    b[0] = 1.0f;
    const KrylovResult result = solve_second_kind(shift, b, 1, 1e-6);
    EXPECT_GT(result.residual, 1e-6);
    EXPECT_LE(result.products, 61);

    // Light that never fades has no sum.
    const KrylovResult endless = solve_second_kind([](const std::vector<float>& f) { return f; }, {1.0f, 2.0f}, 1, 1e-6);
    EXPECT_NEAR(endless.residual, 1.0, 1e-6);
    EXPECT_TRUE(std::isfinite(endless.solution[0]) && std::isfinite(endless.solution[1]));
}

TEST(SolveSecondKind, DoesNotDependOnTheNumberOfThreads) {
    constexpr int size = 20'000;
    const Apply blur = [](const std::vector<float>& f) {
        std::vector<float> g(f.size());
        for (std::size_t i = 0; i < f.size(); ++i)
            g[i] = 0.4f * f[(i + 3) % f.size()] + 0.5f * f[(7 * i + 11) % f.size()];
        return g;
    };
    const std::vector<float> b = random_light(3 * size, 8);
    const auto solve = [&](int threads) {
        const ThreadLimit limit(threads);
        return solve_second_kind(blur, b, 3, 1e-3).solution;
    };
    EXPECT_EQ(solve(1), solve(2));
}

} // namespace
} // namespace afterglow
