#include "tests/fuzz/harness.h"
#include "transport/csv_points.h"

// A table of points, or of irradiance.

using namespace afterglow;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string file = input_folder().write("table.csv", text_of(data, size));
    accept_refusal([&] {
        const std::vector<SurfacePoint> points = read_points_csv(file);
        require(!points.empty(), "a table has a line");
        for (const SurfacePoint& p : points)
            require(p.position.allFinite() && std::abs(p.normal.norm() - 1.0f) < 1e-3f,
                    "a point is finite, its normal of unit length");
    });
    accept_refusal([&] {
        const Eigen::Array3Xf values = read_irradiance_csv(file);
        require(values.cols() > 0 && values.allFinite(), "values are there and finite");
    });
    return 0;
}
