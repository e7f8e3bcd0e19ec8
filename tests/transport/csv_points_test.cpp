#include "core/error.h"
#include "tests/support/temporary_folder.h"
#include "transport/csv_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
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

TEST(CsvPoints, TooSmallForAFloatAreZero) {
    // The cube of cos(pi / 2) in double, and less than a double holds before a comma.
    const TemporaryFolder folder;
    const auto points = read_points_csv(folder.write("points.csv", "2.295e-49,-1e-300,1e-40,1e-45,2,-3e-50\n"));
    ASSERT_EQ(points.size(), 1u);
    EXPECT_EQ(points[0].position, Vec3(0.0f, 0.0f, 1e-40f));
    EXPECT_EQ(points[0].normal, Vec3::UnitY());
}

TEST(CsvPoints, FaultsAreNamedWithTheirLine) {
    const std::string good = "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n";
    for (const char* bad : {"1,2,3,0,0", "1,2,3,0,0,1,7", "1,2,3,0,0,1,", "1,2,three,0,0,1",
                            "1,2,,0,0,1", "1,2,nan,0,0,1", "1,2,inf,0,0,1", "1,2,1e99,0,0,1",
                            "1,2,3x,0,0,1", "1,2,3,0,0,0", "1;2;3;0;0;1", "x,y,z,nx,ny,nz"}) {
        EXPECT_NE(complaint(good + bad).find("points.csv: line 3: "), std::string::npos) << bad;
    }
    EXPECT_NE(complaint("x,y,z,nx,ny,nz\n").find("no points"), std::string::npos);
    // Not taken for a header.
    for (const char* bad : {"0.1;0;0.1;0;1;0", "nan,nan,nan,nan,nan,nan", "+x,y,z,0,0,1", "x,y,z", "-,-,-,-,-,-"})
        EXPECT_NE(complaint(std::string(bad) + "\n1,2,3,0,0,1\n").find("points.csv: line 1: "), std::string::npos) << bad;
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

TEST(CsvAnswers, AreTheSameBytesInBlocksOfAnySize) {
    const TemporaryFolder folder;
    std::string text = "x,y,z,nx,ny,nz\n";
    for (int k = 0; k < 10; ++k) text += std::to_string(k) + ",0.1,0.2,0,1,0\n";
    const std::string points = folder.write("points.csv", text);
    const auto answer = [](std::span<const SurfacePoint> block) {
        Eigen::Array3Xf values(3, static_cast<Index>(block.size()));
        for (std::size_t k = 0; k < block.size(); ++k)
            values.col(static_cast<Index>(k)) = block[k].position.array() / 3.0f;
        return values;
    };
    write_irradiance_csv(folder.path("whole.csv"), answer(read_points_csv(points)));
    for (const std::size_t block : {1, 3, 5, 10, 11}) {
        std::size_t most = 0;
        answer_points_csv(points, folder.path("blocks.csv"), [&](std::span<const SurfacePoint> some) {
            most = std::max(most, some.size());
            return answer(some);
        }, block);
        EXPECT_EQ(content_of(folder.path("blocks.csv")), content_of(folder.path("whole.csv"))) << block;
        EXPECT_LE(most, block);
    }
}

TEST(CsvAnswers, DoNotAppearWhereALaterPointIsWrong) {
    const TemporaryFolder folder;
    const auto dark = [](std::span<const SurfacePoint> block) {
        return Eigen::Array3Xf(Eigen::Array3Xf::Zero(3, static_cast<Index>(block.size())));
    };
    const std::string points = folder.write("points.csv", "1,2,3,0,0,1\n1,2,3,0,0,1\n1,2,3,0,0,0\n");
    EXPECT_THROW(answer_points_csv(points, folder.path("e.csv"), dark, 1), FileError);
    EXPECT_THROW(answer_points_csv(folder.write("none.csv", ""), folder.path("e.csv"), dark), FileError);
    EXPECT_EQ(folder.count(), 2u);
}

} // namespace
} // namespace afterglow
