#include "transport/verification.h"

#include "basis/candidates.h"
#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/support/small_transfer.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace afterglow {
namespace {

/// Normally distributed, mean 0, variance 1.
float normal(Rng& rng) {
    const float r = std::sqrt(-2.0f * std::log(1.0f - rng.uniform()));
    return r * std::cos(2.0f * std::numbers::pi_v<float> * rng.uniform());
}

/// An operator that is off by `error` at each place by itself, beside a reference of noise `noise`,
/// both relative to a mean of 2.
VerifiedError simulated(float error, float noise, Index places, std::uint64_t seed) {
    Rng rng(seed, 7);
    Eigen::Array3Xf found(3, places), reference(3, places);
    for (Index k = 0; k < places; ++k)
        for (int c = 0; c < 3; ++c) {
            found(c, k) = 2.0f * (1.0f + error * normal(rng));
            reference(c, k) = 2.0f * (1.0f + noise * normal(rng));
        }
    return compare_with_reference(found, reference,
                                  Eigen::Array3Xf::Constant(3, places, 2.0f * noise));
}

TEST(Verification, TakesTheReferencesNoiseOutAndKnowsItsOwnError) {
    constexpr int runs = 100;
    double mean = 0.0, square = 0.0, standard_error = 0.0;
    for (int run = 0; run < runs; ++run) {
        const VerifiedError e = simulated(0.1f, 0.2f, 1000, static_cast<std::uint64_t>(run));
        EXPECT_NEAR(e.reference_error, 0.2, 0.005);
        mean += e.rel_rmse / runs;
        square += e.rel_rmse * e.rel_rmse / runs;
        standard_error += e.standard_error / runs;
    }
    const double spread = std::sqrt(square - mean * mean);
    EXPECT_NEAR(mean, 0.1, 4.0 * spread / std::sqrt(runs) + 0.002);
    EXPECT_NEAR(standard_error / spread, 1.0, 0.25);
}

TEST(Verification, KnowsWhatOfItsUncertaintyIsNoise) {
    double noisy = 0.0, exact = 0.0;
    constexpr int runs = 40;
    for (int run = 0; run < runs; ++run) {
        const VerifiedError e = simulated(0.1f, 0.2f, 1000, static_cast<std::uint64_t>(run));
        noisy += e.noise_error / e.standard_error / runs;
        exact += simulated(0.1f, 0.0f, 1000, static_cast<std::uint64_t>(run)).noise_error;
    }
    // Colours have noise of their own here, and share it in a reference: a root of three less uncertain.
    EXPECT_NEAR(noisy, std::sqrt(3.0), 0.4);
    EXPECT_EQ(exact, 0.0);
}

TEST(Verification, ACommonErrorIsBias) {
    const Eigen::Array3Xf reference = Eigen::Array3Xf::Constant(3, 40, 2.0f);
    const VerifiedError e =
        compare_with_reference(1.5f * reference, reference, Eigen::Array3Xf::Zero(3, 40));
    EXPECT_NEAR(e.rel_rmse, 0.5, 1e-6);
    EXPECT_NEAR(e.bias, 0.5, 1e-6);
    EXPECT_NEAR(e.standard_error, 0.0, 1e-6);
    EXPECT_EQ(e.places, 40);
}

TEST(Verification, TriesWhatAPersonMight) {
    const Scene scene = make_builtin_scene("builtin:two_rooms");
    const Surface surface(scene);
    const std::vector<Vec3> viewpoints = find_viewpoints(surface, 1);
    const Trial trial = random_trial(surface, viewpoints, 5, 300, 3);
    ASSERT_EQ(trial.lights.size(), 5u);
    ASSERT_EQ(trial.places.size(), 300u);
    for (const Spotlight& light : trial.lights) {
        EXPECT_TRUE(scene.bounds().contains(light.position));
        EXPECT_GE(light.outer_angle, 20.0f);
        EXPECT_LE(light.outer_angle, 50.0f);
        for (const Vec3& axis : {Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY()), Vec3(Vec3::UnitZ())})
            for (const float sign : {-1.0f, 1.0f}) // no closer to a wall than a hand's breadth
                EXPECT_GT(surface.closest_hit({light.position, sign * axis}).distance, 0.05f);
    }
    const Trial again = random_trial(surface, viewpoints, 5, 300, 3);
    const Trial other = random_trial(surface, viewpoints, 5, 300, 4);
    EXPECT_EQ(trial.places.back().position, again.places.back().position);
    EXPECT_EQ(trial.lights.back().position, again.lights.back().position);
    EXPECT_NE(trial.lights.back().position, other.lights.back().position);
}

TEST(Verification, EachEyeLooksEverywhere) {
    // Two closed rooms: whichever of the eyes is in one, all of its walls are seen from there.
    const Scene one = make_builtin_scene("builtin:furnace:0.5");
    Scene scene = one;
    const auto corners = static_cast<std::uint32_t>(one.positions.size());
    for (const Vec3& p : one.positions) scene.positions.push_back(p + Vec3(10, 0, 0));
    for (const Triangle& t : one.triangles) scene.triangles.push_back({t[0] + corners, t[1] + corners, t[2] + corners});
    scene.material_index.resize(scene.triangles.size(), 0);
    const Surface surface(scene);
    for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
        const Trial trial = random_trial(surface, {Vec3::Zero(), Vec3(10, 0, 0)}, 1, 1000, seed);
        std::array<std::array<int, 6>, 2> seen{};
        std::array<int, 2> all{}, first{};
        for (std::size_t k = 0; k < trial.places.size(); ++k) {
            const SurfacePoint& x = trial.places[k];
            const std::size_t room = x.position.x() > 5.0f;
            int axis = 0;
            const float side = x.normal[(x.normal.cwiseAbs().maxCoeff(&axis), axis)];
            ++seen[room][static_cast<std::size_t>(2 * axis + (side > 0.0f))];
            ++all[room];
            first[room] += k % 2 == 0;
        }
        for (std::size_t room = 0; room < 2; ++room) {
            if (all[room] == 0) continue;
            for (const int n : seen[room]) EXPECT_GT(n, 0.02 * all[room]) << "seed " << seed;
            // Every second place comes from either eye: their order is none.
            EXPECT_NEAR(first[room], 0.5 * all[room], 5.0 * std::sqrt(0.25 * all[room])) << "seed " << seed;
        }
    }
}

/// A box whose walls reflect a half.
struct Box {
    Scene scene = make_builtin_scene("builtin:furnace:0.5");
    Surface surface{scene};
    TransferOperator transfer = precompute(surface, medium_options());

    VerifiedError verified(std::uint64_t seed) const {
        const Verifier verifier(surface, find_viewpoints(surface, 1),
                                {.lights = 3, .places = 300, .reference_error = 0.02, .most_rays = 4'000'000, .seed = seed});
        return verifier.error_of(transfer);
    }
};

TEST(Verification, TellsAGoodOperatorFromOneThatIsOff) {
    Box box;
    const VerifiedError good = box.verified(1), again = box.verified(1);
    EXPECT_TRUE(good.any());
    EXPECT_LT(good.rel_rmse, 0.1); // it has few functions and rays
    EXPECT_EQ(good.rel_rmse, again.rel_rmse);
    EXPECT_GE(good.worst, good.rel_rmse);
    EXPECT_LE(good.worst, (1.0 + 1e-12) * std::sqrt(3.0) * good.rel_rmse); // equal where one light makes all of it
    EXPECT_LT(good.reference_error, 0.1);
    // Walls that reflect 0.4 instead of 0.5: an indirect bounce of a fifth less, and more of the others.
    box.transfer.points.reflectance *= 0.8f;
    const VerifiedError off = box.verified(1);
    EXPECT_GT(off.rel_rmse - 3.0 * off.standard_error, 0.15);
    EXPECT_LT(off.bias, -0.2);
}

} // namespace
} // namespace afterglow
