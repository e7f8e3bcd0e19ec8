#include "tests/statistics/pictures.h"

#include "core/image.h"
#include "tests/statistics/knobs.h"
#include "tests/statistics/put_in.h"
#include "tests/support/statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

// The path tracer against stored means and variances, made by afterglow_make_references.
//
// A pixel's z is Welch's t of its two means, turned into a normal variable, as a variance from 64
// batches is not known exactly. One pixel of 2048 paths is known to about 3 %, so that no single one
// could show an error of 2 %. Hence all scales are tested: pixels, squares of 2 x 2 and of 4 x 4,
// and the whole picture, all colours: 759 z of each of eight pictures, one family with Sidak's correction,
// which rejects from |z| = 4.8 on. The whole picture is known to 3 % / sqrt(192) = 0.2 %: 2 % are eight
// of its standard errors or more; a single pixel shows errors of 15 % and more. Colours share their paths and squares their
// pixels, for which Sidak's correction errs on the safe side.
//
// That the errors are as large as the variances say is tested by the sums of z^2 of each scale but the
// last. A variance that is wrong by v shifts the sum over n pixels by n v, of which the deviation is
// sqrt(2 n): with 192, it has to be wrong by half to be seen. (An error of 2 % of the mean shifts the sum
// over the 12 squares of 4 x 4 by 100 or more.)

namespace afterglow {
namespace {

constexpr int batches = 64;
constexpr int squares[] = {1, 2, 4, 16};

constexpr PathStrategy strategies[] = {PathStrategy::plain, PathStrategy::connected};

using Parameters = std::tuple<PictureSetting, Layer, PathStrategy>;

class Picture : public testing::TestWithParam<Parameters> {
protected:
    struct PValues {
        double largest_z = 1.0, spread = 1.0; // each of a whole picture, judged at `level`
    };
    double level = sidak_level(family_level, picture_settings().size() * std::size(stored_layers)
                                                 * std::size(strategies));

    static PValues against_reference(Fault fault) {
        const auto& [setting, layer, strategy] = GetParam();
        const std::string folder = AFTERGLOW_TESTS "/statistics/references";
        const Image reference = read_exr(mean_file(folder, setting, layer));
        const Image variance = read_exr(variance_file(folder, setting, layer));
        const Scene scene = with_fault(setting.scene(), fault, put_in());
        const Surface surface(scene);
        const PictureEstimate found = render_reference(
            surface, with_fault(setting.light, fault, put_in()), setting.camera, layer,
            {.samples = 2048, .batches = batches, .seed = test_seed(4), .strategy = strategy});

        double least_of_z = 1.0, least_of_spread = 1.0;
        std::size_t z_count = 0, spread_count = 0;
        for (const int square : squares) {
            const auto a = square_means(found.image, found.variance, batches, square);
            const auto b = square_means(reference, variance, reference_options.batches, square);
            double sum_of_squares[3] = {};
            for (std::size_t k = 0; k < a.size(); ++k) {
                const double z = z_score(a[k], b[k]);
                least_of_z = std::min(least_of_z, normal_p_value(z));
                sum_of_squares[k % 3] += z * z;
            }
            z_count += a.size();
            if (a.size() == 3) continue; // the whole picture has but one z a colour
            for (const double sum : sum_of_squares)
                least_of_spread = std::min(least_of_spread, spread_p_value(sum, a.size() / 3));
            spread_count += 3;
        }
        const PValues p{corrected(least_of_z, z_count), corrected(least_of_spread, spread_count)};
        RecordProperty("p_value", std::to_string(p.largest_z));
        RecordProperty("p_value_of_spread", std::to_string(p.spread));
        return p;
    }

private:
    /// The least of n p-values as one: below a level where the least is below sidak_level(level, n).
    static double corrected(double least, std::size_t n) {
        return -std::expm1(static_cast<double>(n) * std::log1p(-std::min(least, 1.0 - 1e-16)));
    }
};

TEST_P(Picture, AgreesWithTheStoredMeansAtEveryScale) {
    const PValues p = against_reference(Fault::none);
    EXPECT_GT(p.largest_z, level);
    EXPECT_GT(p.spread, level);
}

TEST_P(Picture, IsRejectedUnderABrighterLight) {
    const PValues p = against_reference(Fault::bright_light);
    EXPECT_LT(p.largest_z, level);
    EXPECT_LT(p.spread, level);
}

TEST_P(Picture, IsRejectedWithBrighterWalls) {
    const PValues p = against_reference(Fault::bright_walls);
    EXPECT_LT(p.largest_z, level);
    EXPECT_LT(p.spread, level);
}

std::string picture_name(const testing::TestParamInfo<Parameters>& picture) {
    const auto& [setting, layer, strategy] = picture.param;
    return setting.name + "_" + layer_name(layer) + "_" + strategy_name(strategy);
}

INSTANTIATE_TEST_SUITE_P(
    Of, Picture,
    testing::Combine(testing::ValuesIn(picture_settings()), testing::ValuesIn(stored_layers),
                     testing::ValuesIn(strategies)),
    picture_name);

} // namespace
} // namespace afterglow
