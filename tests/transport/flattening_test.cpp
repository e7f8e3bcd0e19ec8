#include "transport/flattening.h"

#include "tests/support/small_transfer.h"
#include "transport/display.h"

#include <gtest/gtest.h>

namespace afterglow {
namespace {

TEST(Flattening, HoldsTheFieldsValuesAtThePointsOfTheLastLevel) {
    const SmallTransfer& small = small_paper_transfer();
    const LightTransport transport(small.transfer, small.surface);
    Spotlight light{.position = {0.278f, 0.5f, 0.28f}};
    light.check();
    const VectorIrradiance field = transport.indirect(light);
    VectorIrradiance flat = field;
    const PointHierarchy& points = small.transfer.points;
    Flattening(points, small.surface).apply(flat);

    const Display display(small.transfer, small.surface);
    const int last = points.levels() - 1;
    for (std::uint32_t j = points.begin(last); j < points.end(last); ++j) {
        const SurfacePoint x = points.point(j);
        bool covered = false;
        const Rgb expected = display.net_irradiance(x, field, covered);
        for (int c = 0; c < 3; ++c) {
            const Vec3 v(flat[9 * j + c], flat[9 * j + 3 + c], flat[9 * j + 6 + c]);
            ASSERT_NEAR(x.normal.dot(v), expected[c], 1e-5f) << "point " << j;
        }
    }
    EXPECT_TRUE(std::equal(field.begin(), field.begin() + 9 * points.begin(last), flat.begin()));
}

} // namespace
} // namespace afterglow
