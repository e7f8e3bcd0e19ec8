#include "core/error.h"
#include "tests/support/temporary_folder.h"
#include "transport/csv_points.h"

#include <gtest/gtest.h>

#include <string>

namespace afterglow {
namespace {

/// The message of the FileError that reading `text` as points throws, or nothing.
std::string complaint(const std::string& text) {
    const TemporaryFolder folder;
    try {
        read_points_csv(folder.write("points.csv", text));
    } catch (const FileError& error) {
        return error.what();
    }
    return {};
}

TEST(CsvPoints, AreReadWithAndWithoutAHeader) {
    const TemporaryFolder folder;
    const std::string rows = "1,2,3,0,0,2\r\n\n -1.5 , +2e-1,3 ,0,-1,0";
    for (const char* header : {"", "x,y,z,nx,ny,nz\n", "\xef\xbb\xbfx,y,z,nx,ny,nz\r\n"}) {
        const auto points = read_points_csv(folder.write("points.csv", std::string(header) + rows));
        ASSERT_EQ(points.size(), 2u);
        EXPECT_EQ(points[0].position, Vec3(1.0f, 2.0f, 3.0f));
        EXPECT_EQ(points[0].normal, Vec3(0.0f, 0.0f, 1.0f));
        EXPECT_EQ(points[1].position, Vec3(-1.5f, 0.2f, 3.0f));
        EXPECT_EQ(points[1].normal, Vec3(0.0f, -1.0f, 0.0f));
    }
}

TEST(CsvPoints, FaultsAreNamedWithTheirLine) {
    const std::string good = "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n";
    for (const char* bad : {"1,2,3,0,0", "1,2,3,0,0,1,7", "1,2,3,0,0,1,", "1,2,three,0,0,1",
                            "1,2,,0,0,1", "1,2,nan,0,0,1", "1,2,inf,0,0,1", "1,2,1e99,0,0,1",
                            "1,2,3x,0,0,1", "1,2,3,0,0,0", "1;2;3;0;0;1", "x,y,z,nx,ny,nz"}) {
        EXPECT_NE(complaint(good + bad).find("points.csv: line 3: "), std::string::npos) << bad;
    }
    EXPECT_NE(complaint("x,y,z,nx,ny,nz\n").find("no points"), std::string::npos);
    EXPECT_NE(complaint("").find("no points"), std::string::npos);
    EXPECT_THROW(read_points_csv("/nonexistent/points.csv"), FileError);
}

TEST(CsvIrradiance, ComesBackAsTheSameFloats) {
    const TemporaryFolder folder;
    Eigen::Array3Xf values(3, 3);
    values << 0.1f, 1e-30f, 16777217.0f, 0.0f, 1.0f / 3.0f, 1e-45f, 3.4e38f, 2.0f, 0.7f;
    write_irradiance_csv(folder.path("e.csv"), values);
    EXPECT_TRUE((read_irradiance_csv(folder.path("e.csv")) == values).all());
    EXPECT_EQ(folder.count(), 1u);
    EXPECT_THROW(write_irradiance_csv(folder.path("no/such/e.csv"), values), Error);
}

} // namespace
} // namespace afterglow
