#include "core/file.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

#include <nlohmann/json.hpp>

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>

namespace afterglow {
namespace {

TEST(CommandChart, MeasuresDrawsAndGoesOnWhereItWas) {
    const TemporaryFolder folder;
    const std::string start = "chart builtin:cornell --brief -o '" + folder.path("c") + "'";
    const std::string runs = folder.path("c/runs.json");
    const Outcome made = run(start);
    ASSERT_EQ(made.status, 0) << made.err;
    for (const char* file : {"runs.csv", "error_time_builtin_cornell.svg", "error_bytes_builtin_cornell.png",
                             "error_update_builtin_cornell.png", "stages_builtin_cornell.png", "break_even.svg"})
        EXPECT_GT(std::filesystem::file_size(folder.path("c/" + std::string(file))), 500u) << file;

    const nlohmann::json json = nlohmann::json::parse(content_of(runs));
    std::map<std::string, std::map<double, double>> error;
    for (const auto& point : json["runs"]) {
        error[point["sweep"]][point["value"]] = point["rel_rmse"];
        EXPECT_GT(point["seconds"], 0.0);
    }
    EXPECT_GT(error["spacing"][4.0], error["spacing"][2.8]);
    EXPECT_LE(error["target"][0.2], 1.2 * 0.2);
    // A fourth of the noise's square for four times the paths.
    EXPECT_NEAR(error["path"][4.0] / error["path"][16.0], 2.0, 0.4);

    // Killed before its last point, it measures that one anew, and finds the same.
    nlohmann::ordered_json cut = nlohmann::ordered_json::parse(content_of(runs));
    const auto last = cut["runs"].back();
    cut["runs"].erase(cut["runs"].size() - 1);
    write_file(runs, cut.dump());
    ASSERT_EQ(run(start).status, 0);
    const auto again = nlohmann::ordered_json::parse(content_of(runs))["runs"].back();
    for (const char* key : {"sweep", "value", "rel_rmse", "functions", "links", "bytes"})
        EXPECT_EQ(last[key], again[key]) << key;

    EXPECT_EQ(run(start + " --seed 2").status, 2); // of which nothing is known here
    EXPECT_EQ(run("chart builtin:cornell -o '" + folder.path("c") + "'").status, 2); // that is not brief
    cut["runs"][0]["scene_hash"] = "another";
    write_file(runs, cut.dump());
    const Outcome another = run(start);
    EXPECT_EQ(another.status, 2);
    EXPECT_NE(another.err.find("another scene"), std::string::npos) << another.err;
    write_file(runs, "{\"runs\": [");
    const Outcome damaged = run(start);
    EXPECT_EQ(damaged.status, 1);
    EXPECT_NE(damaged.err.find("runs.json"), std::string::npos) << damaged.err;
}

TEST(CommandChart, MeasuresSomeSweepsAlone) {
    const TemporaryFolder folder;
    const std::string start = "chart builtin:cornell --brief -o '" + folder.path("c") + "' --sweeps ";
    const Outcome made = run(start + "path=4,path=64,target=0.3");
    ASSERT_EQ(made.status, 0) << made.err;
    const nlohmann::json points = nlohmann::json::parse(content_of(folder.path("c/runs.json")))["runs"];
    ASSERT_EQ(points.size(), 3u);
    EXPECT_EQ(points[0]["sweep"], "target");
    EXPECT_EQ(points[0]["value"], 0.3);
    EXPECT_EQ(points[1]["sweep"], "path");
    EXPECT_EQ(points[1]["value"], 4.0);
    EXPECT_EQ(points[2]["value"], 64.0); // not one of the few that are measured otherwise
    EXPECT_FALSE(std::filesystem::exists(folder.path("c/map_builtin_cornell.json")));

    // The path tracer alone has no files to draw.
    const Outcome traced = run("chart --brief --sweeps path=4 builtin:cornell -o '" + folder.path("p") + "'");
    EXPECT_EQ(traced.status, 0) << traced.err;
    EXPECT_TRUE(std::filesystem::exists(folder.path("p/error_time_builtin_cornell.png")));
    EXPECT_FALSE(std::filesystem::exists(folder.path("p/error_bytes_builtin_cornell.png")));

    // A search that has no time has its first step.
    const Outcome limited = run("chart builtin:cornell --brief -o '" + folder.path("t") + "' --max-time 0.1 --sweeps target=0.03");
    ASSERT_EQ(limited.status, 0) << limited.err;
    const nlohmann::json first = nlohmann::json::parse(content_of(folder.path("t/runs.json")))["runs"][0];
    EXPECT_GT(first["rel_rmse"], 0.04);
    EXPECT_EQ(first["coarse_radius"], points[0]["coarse_radius"]); // which is enough for 30 %

    EXPECT_EQ(run(start + "target=0.3 --max-time 9").status, 2); // those that are there were not limited
    EXPECT_EQ(run(start + "target=0.3 --max-time 0").status, 2);
    EXPECT_EQ(run(start + "dance").status, 2);
    EXPECT_EQ(run(start + "target=0.31").status, 2);
    EXPECT_EQ(run(start + "target=much").status, 2);
}

TEST(CommandChart, NeedsAFolderItCanWriteTo) {
    EXPECT_EQ(run("chart builtin:cornell --brief -o /proc/none").status, 1);
    EXPECT_EQ(run("chart --brief -o /tmp").status, 2);
}

} // namespace
} // namespace afterglow
