#include "core/image.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"
#include "transport/csv_points.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <unistd.h>

// precompute, and the commands that use what it made.

namespace afterglow {
namespace {

const std::string small_settings =
    " --coarse-radius 0.4 --receiver-levels 3 --sender-levels 2 --rays 64";

std::string quoted(const std::string& path) {
    return " '" + path + "'";
}

/// A small file of the Cornell box, made once.
class CommandTransfer : public ::testing::Test {
protected:
    static void SetUpTestSuite() {
        made_ = new TemporaryFolder;
        ASSERT_EQ(
            run("precompute builtin:cornell --quiet -o" + quoted(file()) + small_settings).status,
            0);
    }
    static void TearDownTestSuite() { delete made_; }
    static std::string file() { return made_->path("t"); }

    TemporaryFolder folder;

private:
    static inline TemporaryFolder* made_ = nullptr;
};

TEST_F(CommandTransfer, PrecomputeTellsOnStderrAndReportsAsJson) {
    const Outcome made = run("precompute builtin:cornell -o" + quoted(folder.path("t"))
                             + " --report" + quoted(folder.path("r.json")) + small_settings);
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_EQ(made.out, "");
    EXPECT_NE(made.err.find("30 triangles"), std::string::npos) << made.err;
    EXPECT_EQ(made.err.find('\r'), std::string::npos) << "progress is for terminals";
    const std::string report = content_of(folder.path("r.json"));
    for (const char* key : {"\"seconds\"", "\"gather\"", "\"write\"", "\"candidates\"",
                            "\"scene_hash\"", "\"options\"", "\"bytes\""})
        EXPECT_NE(report.find(key), std::string::npos) << key;
    EXPECT_EQ(content_of(folder.path("t")), content_of(file())) << "the same bytes again";
    EXPECT_EQ(folder.count(), 2u);
}

TEST_F(CommandTransfer, PrecomputeGivesTheSameBytesOnAnyNumberOfThreads) {
    for (const char* threads : {"1", "2"}) {
        const std::string path = folder.path(threads);
        const Outcome made = run("precompute builtin:cornell --quiet --threads "
                                 + std::string(threads) + " -o" + quoted(path) + small_settings);
        EXPECT_EQ(made.err, "");
        EXPECT_EQ(content_of(path), content_of(file())) << threads << " threads";
    }
    const std::string seeded = folder.path("seeded");
    ASSERT_EQ(run("precompute builtin:cornell --seed 2 -o" + quoted(seeded) + small_settings).status, 0);
    EXPECT_NE(content_of(seeded), content_of(file()));
}

TEST_F(CommandTransfer, WhatPrecomputeCannotDoIsStatusTwoAndLeavesNothing) {
    const std::string start = "precompute builtin:cornell -o" + quoted(folder.path("t"));
    for (const char* options : {"--operator oracle",
                                "--target-error 0",
                                "--target-error -1",
                                "--target-error x",
                                "--epsilon -1",
                                "--epsilon 0.1 --target-error 0.1",
                                "--epsilon 0.1 --max-time 5",
                                "--coarse-radius 0.2 --max-time 5",
                                "--coarse-radius 0.2 --draft",
                                "--draft --target-error 0.1",
                                "--max-time 0",
                                "--max-time nan",
                                "--max-memory -1",
                                "--operator paper --max-time 5",
                                "--viewpoint 0,0",
                                "--viewpoint 0,0,nan",
                                "--coarse-radius 0",
                                "--coarse-radius -1",
                                "--coarse-radius inf",
                                "--receiver-levels 1",
                                "--receiver-levels 99",
                                "--sender-levels 0",
                                "--sender-levels 11",
                                "--rays 0",
                                "--rays 100000",
                                "--rays many",
                                "--bounces -1",
                                "--bounces 1e9",
                                "--operator paper --target-error 0.1",
                                "--operator paper --bounces 0",
                                "--operator paper --sender-levels 7",
                                "--seed -1",
                                "--threads -1",
                                "--spp 4",
                                "extra"}) {
        SCOPED_TRACE(options);
        expect_failure(run(start + " " + options), 2);
    }
    expect_failure(run("precompute builtin:nowhere -o" + quoted(folder.path("t"))), 2);
    expect_failure(run("precompute builtin:cornell"), 2);
    EXPECT_EQ(folder.count(), 0u);
}

TEST_F(CommandTransfer, TargetErrorTellsItsStepsAndWhatItCouldNotReach) {
    const std::string start = "precompute builtin:cornell -o" + quoted(folder.path("t"));
    const Outcome made = run(start + " --target-error 0.2 --report" + quoted(folder.path("r.json")));
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_NE(made.err.find("\nstep 1: spacing "), std::string::npos) << made.err;
    EXPECT_NE(made.err.find("verified error"), std::string::npos) << made.err;
    EXPECT_EQ(made.err.find("not reached"), std::string::npos) << made.err;
    EXPECT_NE(content_of(folder.path("r.json")).find("\"tuning\": ["), std::string::npos);

    const Outcome by_hand = run(start + " --target-error 0.2" + small_settings);
    EXPECT_EQ(by_hand.status, 0) << by_hand.err;
    EXPECT_EQ(by_hand.err.find("step"), std::string::npos) << by_hand.err;

    const Outcome hurried = run(start + " --target-error 0.001 --max-time 0.01");
    EXPECT_EQ(hurried.status, 0) << hurried.err;
    EXPECT_NE(hurried.err.find("0.1 % was not reached: a finer step would exceed --max-time"),
              std::string::npos) << hurried.err;
}

TEST_F(CommandTransfer, ADraftIsSmallAndNotVerified) {
    const std::string draft = folder.path("draft");
    const Outcome made = run("precompute builtin:cornell --draft -o" + quoted(draft));
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_EQ(made.err.find("verified"), std::string::npos) << made.err;
    EXPECT_LT(content_of(draft).size(), 4'000'000u); // 11 MB otherwise
}

TEST_F(CommandTransfer, WhereNothingCanBeWrittenNothingIsComputed) {
    const std::string start = "precompute builtin:cornell" + small_settings;
    expect_failure(run(start + " -o" + quoted(folder.path("no/such/t"))), 1);
    expect_failure(run(start + " -o" + quoted(folder.path("."))), 1);
    expect_failure(run(start + " -o" + quoted(folder.path("t")) + " --report"
                       + quoted(folder.path("no/such/r.json"))),
                   1);
    expect_failure(
        run("precompute" + quoted(folder.path("none.obj")) + " -o" + quoted(folder.path("t"))), 1);
    EXPECT_EQ(folder.count(), 0u);
}

TEST_F(CommandTransfer, AFullDiskIsStatusOneAndLeavesTheOldFile) {
    expect_failure(run("precompute builtin:cornell --quiet -o /dev/full" + small_settings), 1);
    const std::string path = folder.write("t", "old");
    // Writing beyond the limit of file sizes fails as on a full disk; in blocks of 512 or 1024
    // bytes.
    expect_failure(run("precompute builtin:cornell --quiet -o" + quoted(path) + small_settings,
                       "ulimit -f 20; "),
                   1);
    EXPECT_EQ(content_of(path), "old");
    EXPECT_EQ(folder.count(), 1u);
}

TEST_F(CommandTransfer, ResultsThatCannotBePrintedAreStatusOne) {
    for (const std::string stream : {">/dev/full", ">&-"})
        for (const std::string& command : {"info" + quoted(file()), "info --json" + quoted(file()), std::string("--help")}) {
            SCOPED_TRACE(command + stream);
            const Outcome outcome = run(command, "with_stream() { \"$@\" " + stream + "; }; with_stream ");
            expect_failure(outcome, 1);
            EXPECT_NE(outcome.err.find("standard output"), std::string::npos) << outcome.err;
        }
}

TEST_F(CommandTransfer, ClosedStreamsDoNotEndUpInTheFile) {
    const std::string path = folder.path("t");
    const Outcome made = run("precompute builtin:cornell -o" + quoted(path) + small_settings,
                             "closed() { \"$@\" <&- >&- 2>&-; }; closed ");
    EXPECT_EQ(made.status, 0);
    EXPECT_EQ(content_of(path), content_of(file()));
}

TEST_F(CommandTransfer, AFolderThatTakesNoFilesIsStatusOne) {
    if (!std::filesystem::is_directory("/proc/self")) GTEST_SKIP() << "no /proc here";
    expect_failure(run("precompute builtin:cornell --quiet -o /proc/self/t" + small_settings), 1); // even of root
    expect_failure(run("render" + quoted(file()) + " --quiet -o /proc/self/a.png" + light + camera), 1);
    expect_failure(run("precompute builtin:cornell --quiet --checkpoint /proc/self/c -o" + quoted(folder.path("t"))
                       + small_settings), 1);
    EXPECT_EQ(folder.count(), 0u);
}

TEST_F(CommandTransfer, AReadOnlyFolderIsStatusOneAtOnce) {
    const std::string closed = folder.path("closed");
    std::filesystem::create_directory(closed);
    std::filesystem::permissions(closed, std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
    if (::access(closed.c_str(), W_OK) == 0) GTEST_SKIP() << "this user may write everywhere";
    expect_failure(run("precompute builtin:cornell --quiet -o" + quoted(closed + "/t") + small_settings), 1);
    expect_failure(run("render" + quoted(file()) + " -o" + quoted(closed + "/a.png") + light + camera), 1);
}

TEST_F(CommandTransfer, CheckpointsOfOtherRunsAreRefusedAndThoseOfThisGoOn) {
    const std::string checkpoint = " --checkpoint" + quoted(folder.path("c"));
    const std::string start = "precompute builtin:cornell -o" + quoted(folder.path("t")) + checkpoint;
    for (const char* options : {"--max-time 5", "--max-memory 1", "--operator paper", "--checkpoint-every -1"})
        expect_failure(run(start + " " + options), 2);
    expect_failure(run("precompute builtin:cornell -o" + quoted(folder.path("c")) + checkpoint), 2);
    expect_failure(run("precompute builtin:cornell --checkpoint-every 1 -o" + quoted(folder.path("t"))), 2);
    EXPECT_EQ(folder.count(), 0u);

    // All goes well until the file is written.
    folder.write("t", "old");
    expect_failure(run("precompute builtin:cornell --quiet -o /dev/full" + checkpoint + small_settings), 1);
    ASSERT_TRUE(std::filesystem::exists(folder.path("c")));
    for (const char* change : {" --seed 2", " --bounces 2", " --target-error 0.3"})
        expect_failure(run(start + " --quiet" + small_settings + change), 1);
    expect_failure(run("render" + quoted(folder.path("c")) + " -o" + quoted(folder.path("a.png")) + light + camera), 1);
    EXPECT_EQ(content_of(folder.path("t")), "old");
    const Outcome went_on = run(start + small_settings);
    EXPECT_EQ(went_on.status, 0) << went_on.err;
    EXPECT_NE(went_on.err.find("are there already"), std::string::npos) << went_on.err;
    EXPECT_EQ(content_of(folder.path("t")), content_of(file()));
    EXPECT_EQ(folder.count(), 1u) << "the checkpoint is gone";
}

TEST_F(CommandTransfer, AnEditedMaterialOrTextureIsRefusedByEveryCommand) {
    const auto write_material = [&](const std::string& colour) {
        folder.write("a.mtl", "newmtl m\nKd " + colour + "\nmap_Kd a.tga\n");
    };
    const auto write_texture = [&](const std::string& texel) {
        using namespace std::string_literals;
        folder.write("a.tga", "\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\x18\0"s + texel); // one, 24 bits
    };
    folder.write("a.obj", "mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0.5 0.5\n"
                          "f 1/1 2/1 3/1\nf 1/1 4/1 3/1\nf 1/1 2/1 4/1\n");
    folder.write("p.csv", "0.1,0,0.1,0,1,0\n");
    write_material("0.5 0.5 0.5");
    write_texture("abc");
    ASSERT_EQ(run("precompute" + quoted(folder.path("a.obj")) + " --quiet --viewpoint 0.3,0.3,0.3 -o"
                  + quoted(folder.path("t")) + small_settings).status, 0);
    const std::string render = "render" + quoted(folder.path("t")) + " --quiet -o" + quoted(folder.path("a.png")) + light + camera;
    const std::string query = "query" + quoted(folder.path("t")) + " --points" + quoted(folder.path("p.csv")) + " -o"
                              + quoted(folder.path("e.csv")) + light;
    const auto expect_refusal = [&](const char* what) {
        SCOPED_TRACE(what);
        for (const std::string& command : {render, query}) {
            const Outcome outcome = run(command);
            expect_failure(outcome, 1);
            EXPECT_NE(outcome.err.find("content hash"), std::string::npos) << outcome.err;
        }
    };
    write_material("0.5 0.5 0.6");
    expect_refusal("the material");
    write_material("0.5 0.5 0.5");
    write_texture("abd");
    expect_refusal("the texture");
    std::filesystem::remove(folder.path("a.tga"));
    expect_refusal("a texture that is gone");
    write_texture("abc");
    EXPECT_EQ(run(query).status, 0) << "all is as it was";

    // The scene that a transfer file names is read, too.
    const std::string scene = content_of(folder.path("a.obj"));
    for (const std::string& command : {"query" + quoted(folder.path("t")) + " --points" + quoted(folder.path("p.csv")) + light,
                                       "render" + quoted(folder.path("t")) + light + camera})
        EXPECT_EQ(run(command + " --quiet -o" + quoted(folder.path("./a.obj"))).status, 2);
    EXPECT_EQ(content_of(folder.path("a.obj")), scene);
}

TEST_F(CommandTransfer, RenderMakesEachLayerWithItsProvenance) {
    std::map<std::string, Image> layer;
    for (const char* name : {"direct", "indirect", "full", "irradiance"}) {
        const std::string path = folder.path(std::string(name) + ".exr");
        const Outcome made = run("render" + quoted(file()) + " -o" + quoted(path) + " --layer "
                                 + name + light + camera);
        ASSERT_EQ(made.status, 0) << made.err;
        EXPECT_EQ(made.out, "");
        layer[name] = read_exr(path);
        EXPECT_EQ(layer[name].attributes.at("afterglow.layer"), name);
        EXPECT_EQ(layer[name].attributes.at("afterglow.uncovered_pixels"), "0");
        EXPECT_TRUE(layer[name].attributes.contains("afterglow.scene_hash"));
    }
    double sum = 0.0;
    for (std::size_t k = 0; k < layer["full"].rgb.size(); ++k) {
        const float both = layer["direct"].rgb[k] + layer["indirect"].rgb[k];
        // Three roundings to half, of eleven bits.
        EXPECT_NEAR(layer["full"].rgb[k], both, 2e-3f * both);
        EXPECT_GE(layer["irradiance"].rgb[k], layer["indirect"].rgb[k]);
        sum += layer["indirect"].rgb[k];
    }
    EXPECT_GT(sum, 0.0);
}

TEST_F(CommandTransfer, RenderIsTheSameOnAnyNumberOfThreads) {
    std::string pictures[2];
    for (int threads : {1, 2}) {
        const Outcome made =
            run("render" + quoted(file()) + " --quiet --layer full --threads "
                + std::to_string(threads) + " -o" + quoted(folder.path("a.png")) + light + camera);
        EXPECT_EQ(made.status, 0) << made.err;
        EXPECT_EQ(made.err, "");
        pictures[threads - 1] = content_of(folder.path("a.png"));
    }
    EXPECT_EQ(pictures[0], pictures[1]);
}

TEST_F(CommandTransfer, QueryIsCloseToTheReference) {
    const std::string points = folder.write(
        "p.csv", "x,y,z,nx,ny,nz\n0.1,0,0.1,0,1,0\n0.3,0.3,0.5592,0,0,-1\n0.2,0.5488,0.2,0,-1,0\n");
    const Outcome made = run("query" + quoted(file()) + " --points" + quoted(points) + " -o"
                             + quoted(folder.path("a.csv")) + light);
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_EQ(made.out + made.err, "");
    run("reference builtin:cornell --spp 16384 --points" + quoted(points) + " -o"
        + quoted(folder.path("b.csv")) + light);
    const Eigen::Array3Xf e = read_irradiance_csv(folder.path("a.csv"));
    const Eigen::Array3Xf reference = read_irradiance_csv(folder.path("b.csv"));
    ASSERT_EQ(e.cols(), 3);
    // A few hundred points for the whole box: right in size, not more.
    EXPECT_LT((e - reference).abs().mean(), 0.25f * reference.mean());
}

TEST_F(CommandTransfer, PointsThatNothingCoversAreCounted) {
    const std::string points =
        folder.write("p.csv", "0.1,0,0.1,0,1,0\n0.278,0.273,-5,0,0,-1\n0.1,0,0.1,0,-1,0\n");
    const std::string query = "query" + quoted(file()) + " --points" + quoted(points) + " -o"
                              + quoted(folder.path("a.csv")) + light;
    const Outcome made = run(query);
    EXPECT_EQ(made.status, 0);
    EXPECT_NE(made.err.find("2 of 3 points"), std::string::npos) << made.err;
    const Eigen::Array3Xf e = read_irradiance_csv(folder.path("a.csv"));
    EXPECT_TRUE((e.col(0) > 0.0f).all());
    EXPECT_TRUE((e.rightCols(2) == 0.0f).all());
    EXPECT_EQ(run(query + " --quiet").err, "");
}

TEST_F(CommandTransfer, PointsOfFewDigitsAreMovedOntoTheSurface) {
    const auto answer = [&](const std::string& subcommand, const std::string& point, std::string& err) {
        const std::string points = folder.write("p.csv", point + ",0,1,0\n"), out = folder.path("a.csv");
        const Outcome made = run(subcommand + " --points" + quoted(points) + " -o" + quoted(out) + light);
        EXPECT_EQ(made.status, 0) << made.err;
        err = made.err;
        return read_irradiance_csv(out)(1, 0);
    };
    for (const std::string& subcommand : {"query" + quoted(file()), std::string("reference builtin:cornell --spp 64")}) {
        std::string of_exact, of_rounded, of_none;
        const float exact = answer(subcommand, "0.1,0,0.1", of_exact);
        EXPECT_GT(exact, 0.0f);
        EXPECT_EQ(of_exact.find("points"), std::string::npos) << of_exact;
        EXPECT_NEAR(answer(subcommand, "0.1,-0.0004,0.1", of_rounded), exact, 1e-4f * exact) << "below the floor";
        EXPECT_NE(of_rounded.find("1 of 1 points lay off the surfaces, by 0.0004 at most"), std::string::npos) << of_rounded;
        answer(subcommand, "0.1,0.05,0.1", of_none);
        EXPECT_NE(of_none.find("1 of 1 points are on no surface"), std::string::npos) << of_none;
    }
}

TEST_F(CommandTransfer, InfoTellsAPersonAndAProgram) {
    const Outcome text = run("info" + quoted(file()));
    EXPECT_EQ(text.status, 0) << text.err;
    EXPECT_NE(text.out.find("builtin:cornell"), std::string::npos);
    const Outcome json = run("info --json" + quoted(file()));
    EXPECT_EQ(json.status, 0) << json.err;
    EXPECT_EQ(json.out.find('\n'), json.out.size() - 1);
    for (const char* key : {"\"levels\":[{", "\"functions\":", "\"links\":", "\"bytes\":{",
                            "\"options\":{", "\"scene_hash\":", "\"candidates\":",
                            "\"verified\":{\"rel_rmse\":"})
        EXPECT_NE(json.out.find(key), std::string::npos) << key;
    EXPECT_NE(text.out.find("\nverified    "), std::string::npos) << text.out;
    EXPECT_EQ(text.err + json.err, "");

    const std::string path = folder.path("t");
    ASSERT_EQ(run("precompute builtin:cornell --no-verification -o" + quoted(path) + small_settings).status, 0);
    const std::string unverified = run("info" + quoted(path)).out;
    EXPECT_NE(unverified.find("builtin:cornell"), std::string::npos);
    EXPECT_EQ(unverified.find("verified"), std::string::npos);
}

TEST_F(CommandTransfer, ThePapersOperatorServesAllCommands) {
    const std::string settings = " --coarse-radius 0.2 --receiver-levels 4 --sender-levels 3 --rays 256";
    const std::string path = folder.path("t"), ours = folder.path("n");
    const Outcome made =
        run("precompute builtin:cornell --operator paper --epsilon 0.0005 -o" + quoted(path)
            + " --report" + quoted(folder.path("r.json")) + settings);
    ASSERT_EQ(made.status, 0) << made.err;
    ASSERT_EQ(run("precompute builtin:cornell --quiet -o" + quoted(ours) + settings).status, 0);
    const std::string report = content_of(folder.path("r.json"));
    for (const char* part : {"\"operator\": \"paper\"", "\"bounces\": 4", "\"series\":"})
        EXPECT_NE(report.find(part), std::string::npos) << part;
    EXPECT_NE(run("info --json" + quoted(path)).out.find("\"operator\":\"paper\""),
              std::string::npos);

    std::map<std::string, Image> picture;
    for (const auto& [name, from] : {std::pair("paper", path), std::pair("neumann", ours)}) {
        const std::string image = folder.path(std::string(name) + ".exr");
        const Outcome rendered =
            run("render" + quoted(from) + " --layer indirect -o" + quoted(image) + light + camera);
        ASSERT_EQ(rendered.status, 0) << rendered.err;
        picture[name] = read_exr(image);
    }
    double paper = 0.0, neumann = 0.0;
    for (std::size_t k = 0; k < picture["paper"].rgb.size(); ++k) {
        paper += picture["paper"].rgb[k];
        neumann += picture["neumann"].rgb[k];
    }
    // Four bounces, and refinement that stops early. Twelve seeds: 0.944, standard deviation 0.016.
    EXPECT_NEAR(paper / neumann, 0.944, 0.05);

    const std::string points = folder.write("p.csv", "0.1,0,0.1,0,1,0\n");
    ASSERT_EQ(run("query" + quoted(path) + " --points" + quoted(points) + " -o"
                  + quoted(folder.path("a.csv")) + light)
                  .status,
              0);
    EXPECT_GT(read_irradiance_csv(folder.path("a.csv")).minCoeff(), 0.0f);
}

TEST_F(CommandTransfer, ASceneThatHasChangedIsRefusedByItsHash) {
    const std::string obj =
        folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 3\nf 1 2 4\n");
    ASSERT_EQ(run("precompute" + quoted(obj) + " --quiet --viewpoint 0.3,0.3,0.3 -o"
                  + quoted(folder.path("t")) + small_settings)
                  .status,
              0);
    const std::string render = "render" + quoted(folder.path("t")) + " --quiet -o"
                               + quoted(folder.path("a.png")) + light + camera;
    ASSERT_EQ(run(render).status, 0);
    std::filesystem::remove(folder.path("a.png"));
    std::filesystem::copy_file(obj, folder.path("copy.obj"));

    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n");
    const Outcome changed = run(render);
    expect_failure(changed, 1);
    EXPECT_NE(changed.err.find("content hash"), std::string::npos);
    std::filesystem::remove(obj);
    const Outcome missing = run(render);
    expect_failure(missing, 1);
    EXPECT_NE(missing.err.find("--scene"), std::string::npos);
    expect_failure(run(render + " --scene builtin:cornell"), 1);
    EXPECT_FALSE(std::filesystem::exists(folder.path("a.png")));
    EXPECT_EQ(run(render + " --scene" + quoted(folder.path("copy.obj"))).status, 0);
}

TEST_F(CommandTransfer, WrongUseOfATransferFileIsToldInOneLine) {
    const std::string picture = " -o" + quoted(folder.path("a.png"));
    const std::string render = "render" + quoted(file()) + picture + light;
    for (const std::string& arguments :
         {render, render + camera + " --layer glossy", render + camera + " --samples 0",
          render + camera + " --exposure 0", render + camera + " --spp 3",
          "render" + quoted(file()) + picture + camera, "render" + picture + light + camera,
          "query" + quoted(file()) + " -o" + quoted(folder.path("a.csv")) + light,
          std::string("info"), "render" + quoted(file()) + " -o a.jpg" + light + camera}) {
        SCOPED_TRACE(arguments);
        expect_failure(run(arguments), 2);
    }
    const TemporaryFolder inputs;
    const std::string no_transfer = quoted(inputs.write("a.obj", "v 0 0 0\n"));
    for (const std::string& arguments :
         {"render" + no_transfer + picture + light + camera, "info" + no_transfer,
          "info" + quoted(folder.path("none")),
          "render" + quoted(file()) + " -o" + quoted(folder.path("no/such/a.exr")) + light + camera,
          "query" + quoted(file()) + " --points" + no_transfer + " -o"
              + quoted(folder.path("a.csv")) + light}) {
        SCOPED_TRACE(arguments);
        expect_failure(run(arguments), 1);
    }
    EXPECT_EQ(folder.count(), 0u);
}

} // namespace
} // namespace afterglow
