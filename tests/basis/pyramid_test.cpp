#include "basis/pyramid.h"
#include "core/builtin_scenes.h"
#include "tests/support/random_values.h"
#include "tests/support/shepard_oracle.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

namespace afterglow {
namespace {

/// A hierarchy of the printed shape.
struct PyramidExample {
    Scene scene = make_builtin_scene("builtin:cornell");
    Surface surface{scene};
    PointHierarchy points;
    Pyramid pyramid;
    PullOperator pull;

    PyramidExample() {
        CandidateSource source(surface, {*scene.viewpoint}, 1);
        points = build_hierarchy(
            source, {.coarse_radius = 0.2f, .levels = 4, .shape = BasisShape::paper()});
        const ShepardBasis basis(points, surface, false);
        pyramid = make_pyramid(basis, 4);
        pull = make_point_pull(basis, 3);
    }
};

const PyramidExample& pyramid_example() {
    static const PyramidExample made;
    return made;
}

/// sum_k B_k(x) alpha_k over the levels [0, levels), by the formula.
double synthesis(const PointHierarchy& points, int levels, const SurfacePoint& x,
                 const std::vector<float>& coefficients, int channels, int channel) {
    double sum = 0.0;
    for (int l = 0; l < levels; ++l)
        for (const auto& [k, share] : shepard_by_formula(points, l, x, nullptr))
            sum += share * coefficients[channels * k + channel];
    return sum;
}

TEST(Pyramid, HasWhatTheCoarserLevelsDoNotSayAsCoefficients) {
    const auto& [scene, surface, points, pyramid, pull] = pyramid_example();
    for (const int levels : {1, 3, 4}) {
        const std::vector<float> values = random_values(2 * points.end(levels - 1), 1);
        std::vector<float> coefficients = values;
        pyramid.analyse(points, levels, 2, coefficients);
        for (int l = 0; l < levels; ++l)
            for (std::uint32_t i = points.begin(l); i < points.end(l); i += 7)
                for (int c = 0; c < 2; ++c)
                    ASSERT_NEAR(coefficients[2 * i + c]
                                    + synthesis(points, l, points.point(i), coefficients, 2, c),
                                values[2 * i + c], 2e-5)
                        << "level " << l << ", point " << i;
    }
}

TEST(Pyramid, HasAConstantOnTheFirstLevelThatCoversAPoint) {
    const auto& [scene, surface, points, pyramid, pull] = pyramid_example();
    std::vector<float> values(points.size(), 3.0f);
    pyramid.analyse(points, 4, 1, values);
    std::uint32_t covered = 0;
    for (std::uint32_t i = points.begin(1); i < points.size(); ++i)
        if (!shepard_by_formula(points, 0, points.point(i), nullptr).empty()) {
            EXPECT_NEAR(values[i], 0.0f, 1e-5f) << i;
            ++covered;
        }
    EXPECT_GT(covered, points.size() / 2);
}

TEST(PointPull, MakesAFunctionTheMeanOfItsChildren) {
    const auto& [scene, surface, points, pyramid, pull] = pyramid_example();
    ASSERT_EQ(pull.children.rows(), points.begin(2));
    std::vector<std::map<std::uint32_t, double>> expected(points.begin(2));
    for (int l = 0; l < 2; ++l)
        for (std::uint32_t c = points.begin(l + 1); c < points.end(l + 1); ++c)
            for (const auto& [k, share] : shepard_by_formula(points, l, points.point(c), nullptr))
                expected[k][c] = share;
    for (std::uint32_t k = 0; k < points.begin(2); ++k) {
        double sum = 0.0;
        for (const auto& [c, share] : expected[k])
            sum += share;
        std::map<std::uint32_t, double> found;
        for (std::size_t e = 0; e < pull.children.indices(k).size(); ++e)
            found[pull.children.indices(k)[e]] = pull.children.values(k)[e];
        EXPECT_LE(found.size(), expected[k].size());
        for (const auto& [c, share] : expected[k])
            EXPECT_NEAR(found[c], share / sum, 1e-4) << k << ", " << c;
    }
}

} // namespace
} // namespace afterglow
