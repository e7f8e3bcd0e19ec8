#include "basis/openness.h"
#include "tests/support/surface_samples.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace afterglow {
namespace {

constexpr float distances[openness_distances] = {0.0625f, 0.25f, 1.0f, 4.0f}; // D_k in units of R
using std::numbers::pi;

/// F_k - n at (h, 0, 0) in a right-angled corner whose wall is x = 0: a ray meets the wall after
/// h / -omega_x, and what is farther than 16 R is not seen. Midpoint rule over (cos, phi).
Openness corner_by_integration(double h, double spacing) {
    constexpr int steps = 800;
    Eigen::Matrix<double, Openness::RowsAtCompileTime, 1> sum;
    sum.setZero();
    for (int i = 0; i < steps; ++i)
        for (int j = 0; j < 2 * steps; ++j) {
            const double cosine = (i + 0.5) / steps, phi = pi * (j + 0.5) / steps;
            const double sine = std::sqrt(1.0 - cosine * cosine);
            const Eigen::Vector3d omega(sine * std::cos(phi), cosine, sine * std::sin(phi));
            const double t = omega.x() < 0.0 ? h / -omega.x() : 1e9;
            for (int k = 0; k < openness_distances; ++k) {
                const double open =
                    t < 16.0 * spacing ? 1.0 - std::exp(-t / (distances[k] * spacing)) : 1.0;
                sum.segment<3>(3 * k) += omega * open * (pi / steps / steps) / pi;
            }
        }
    for (int k = 0; k < openness_distances; ++k)
        sum[3 * k + 1] -= 1.0;
    return sum.cast<float>();
}

TEST(OpennessProbe, IsZeroOnOpenGround) {
    const Scene ground = make_ground(100.0f);
    const Surface surface(ground);
    // F = n but for the error of the quadrature, which falls with the rays.
    for (const auto& [rays, tolerance] : {std::pair(48, 0.05f), {512, 0.008f}, {8192, 1e-3f}}) {
        const OpennessProbe probe(surface, 1.0f, rays);
        EXPECT_LT(probe({Vec3(3, 0, 4), Vec3::UnitY()}).cwiseAbs().maxCoeff(), tolerance)
            << rays << " rays";
    }
}

TEST(OpennessProbe, InACornerIsItsIntegral) {
    const Scene corner = make_corner(1000.0f);
    const Surface surface(corner);
    for (const float spacing : {1.0f, 3.0f}) {
        const OpennessProbe probe(surface, spacing, 16384);
        for (const float h : {0.02f, 0.3f, 1.0f, 5.0f}) {
            const Openness exact = corner_by_integration(h, spacing);
            const Openness measured = probe({Vec3(h, 0, 0), Vec3::UnitY()});
            for (int c = 0; c < exact.size(); ++c)
                EXPECT_NEAR(measured[c], exact[c], 2e-3f) << "h " << h << ", component " << c;
            EXPECT_GT(exact.cwiseAbs().maxCoeff(), 0.05f) << "nothing to see here";
        }
    }
}

TEST(OpennessProbe, ScalesWithTheScene) {
    const Scene corner = make_corner(1000.0f);
    const Surface surface(corner);
    const Openness small = OpennessProbe(surface, 0.5f, 48)({Vec3(0.4f, 0, 0), Vec3::UnitY()});
    const Openness large = OpennessProbe(surface, 5.0f, 48)({Vec3(4.0f, 0, 0), Vec3::UnitY()});
    EXPECT_LT((small - large).cwiseAbs().maxCoeff(), 1e-3f);
}

TEST(OpennessProbe, IsEqualInEqualSurroundings) {
    // The same rays everywhere: no noise between two places beside the same wall.
    const Scene corner = make_corner(1000.0f);
    const Surface surface(corner);
    const OpennessProbe probe(surface, 1.0f, 48);
    const Openness here = probe({Vec3(0.5f, 0, 0), Vec3::UnitY()});
    const Openness there = probe({Vec3(0.5f, 0, 20), Vec3::UnitY()});
    const Openness away = probe({Vec3(0.8f, 0, 0), Vec3::UnitY()});
    EXPECT_LT(openness_difference2(here, there), 1e-6f);
    EXPECT_GT(openness_difference2(here, away), 1e-3f);
    EXPECT_FLOAT_EQ(openness_difference2(here, away), (here - away).squaredNorm());
}

} // namespace
} // namespace afterglow
