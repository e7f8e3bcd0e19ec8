#include "core/image.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"
#include "transport/csv_points.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

namespace afterglow {
namespace {

TEST(CommandLine, ToldToHelpItDoes) {
    for (const char* arguments : {"--help", "reference --help", "compare --help", "--version"}) {
        const Outcome help = run(arguments);
        EXPECT_EQ(help.status, 0);
        EXPECT_NE(help.out, "");
        EXPECT_EQ(help.err, "");
    }
}

TEST(CommandLine, WrongUsageIsStatusTwo) {
    const TemporaryFolder folder;
    const std::string picture = "-o '" + folder.path("a.exr") + "'";
    const std::string good = "reference builtin:cornell " + picture + light + camera;
    for (const std::string& arguments :
         {std::string(),
          std::string("frobnicate"),
          std::string("reference"),
          good + " --frobnicate",
          good + " --layer glossy",
          good + " --strategy lucky",
          good + " --spp 0",
          good + " --spp 4 --target-error 0.1",
          good + " --target-error 0",
          good + " --target-error nan",
          good + " --threads -1",
          good + " --size 0x5",
          good + " --size 16",
          good + " --camera-fov 180",
          good + " --camera-up 0,0,1",
          "reference builtin:nowhere " + picture + light + camera,
          "reference builtin:cornell " + picture + light,
          "reference builtin:cornell " + picture + camera,
          "reference builtin:cornell " + picture + camera
              + " --light-position 0,0 --light-direction 0,-1,0",
          "reference builtin:cornell " + picture + camera
              + " --light-position 0,0,x --light-direction 0,-1,0",
          "reference builtin:cornell " + picture + camera
              + " --light-position 0,0,inf --light-direction 0,-1,0",
          "reference builtin:cornell " + picture + camera
              + " --light-position 0,0,0 --light-direction 0,0,0",
          "reference builtin:cornell " + picture + camera
              + " --light-position 0,0,0 --light-direction 0,-1,0 --light-cone 50,40",
          "reference builtin:cornell " + picture + camera
              + " --light-position 0,0,0 --light-direction 0,-1,0 --light-intensity -1,0,0",
          std::string("compare a.exr b.csv"),
          std::string("compare a.exr")}) {
        SCOPED_TRACE(arguments);
        expect_failure(run(arguments), 2);
    }
    EXPECT_EQ(folder.count(), 0u);
}

TEST(CommandLine, RefusesNumbersThatNoSceneCanHave) {
    const TemporaryFolder folder;
    const std::string picture = " -o '" + folder.path("a.exr") + "'", table = " -o '" + folder.path("a.csv") + "'";
    const std::string down = " --light-direction 0,-1,0";
    for (const std::string& arguments :
         {"precompute builtin:cornell --draft" + picture + " --viewpoint 1e30,0,0",
          "precompute builtin:cornell --no-verification" + picture + " --coarse-radius 1e20",
          "precompute builtin:cornell --no-verification" + picture + " --coarse-radius 1e-60",
          "precompute builtin:cornell --no-verification" + picture + " --coarse-radius 1e-30",
          "precompute builtin:cornell --no-verification" + picture + " --epsilon 1e39",
          "reference builtin:cornell --strategy connected" + picture + camera + down + " --light-position 1e30,0,0",
          "reference builtin:cornell" + picture + light + " --camera-position 1e30,0,0 --camera-target 0,0,0"}) {
        SCOPED_TRACE(arguments);
        expect_failure(run(arguments + " --quiet"), 2);
    }
    const std::string far = folder.write("far.csv", "1e30,0,0,0,1,0\n");
    expect_failure(run("reference builtin:cornell --quiet --points '" + far + "'" + table + light), 1);
    EXPECT_EQ(folder.count(), 1u);
}

TEST(CommandLine, LosesNoFileToAnother) {
    const TemporaryFolder folder, tabbed;
    const std::string scene = folder.write("s.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const std::string points = folder.write("p.csv", "0,0,0,0,1,0\n");
    const std::string content = content_of(scene);
    const std::string draft = " --draft --quiet -o '", one = folder.path("one"), same = folder.path("./one");
    for (const std::string& arguments :
         {"precompute builtin:cornell" + draft + one + "' --report '" + same + "'",
          "precompute builtin:cornell --quiet -o '" + one + "' --checkpoint '" + same + "'",
          "precompute '" + scene + "'" + draft + scene + "'",
          "precompute '" + scene + "'" + draft + one + "' --report '" + folder.path("./s.obj") + "'",
          "precompute builtin:cornell" + draft + "'",
          "reference builtin:cornell --quiet --points '" + points + "' -o '" + points + "'" + light,
          "reference builtin:cornell --quiet -o '" + one + ".exr' --report '" + one + ".exr'" + light + camera,
          "query '" + scene + "' --points '" + points + "' -o '" + scene + "'" + light,
          "reference builtin:cornell --quiet --points '" + points + "' -o '" + one + "' --camera-fov 40" + light,
          "reference builtin:cornell --quiet --points '" + points + "' -o '" + one + "' --target-error +-0.1" + light,
          "render '" + scene + "' -o '" + one + ".jpg'" + light + camera,
          "reference builtin:cornell -o '" + one + ".jpg'" + light + camera,
          "precompute '" + folder.path("caf\xe9.obj") + "'" + draft + one + "'",
          "precompute '" + tabbed.write("s\tt/s.obj", content) + "'" + draft + one + "'"}) {
        SCOPED_TRACE(arguments);
        expect_failure(run(arguments), 2);
    }
    EXPECT_EQ(content_of(scene), content);
    EXPECT_EQ(folder.count(), 2u);
}

TEST(CommandLine, FaultsOfFilesAreStatusOneAndLeaveNothingBehind) {
    const TemporaryFolder folder, inputs;
    const std::string bad = inputs.write("bad.csv", "0.1,0.2,0.3,0,1,0\n1,2\n");
    const std::string values = inputs.write("e.csv", "1,2,3\n");
    const std::string more = inputs.write("f.csv", "1,2,3\n4,5,6\n");
    const std::string odd = inputs.path("odd.exr"), picture = " -o '" + folder.path("a.exr") + "'";
    Image black(1, 1);
    black.attributes["afterglow.relative_standard_error"] = "n/a";
    write_image(odd, black, PixelType::full_float);
    const std::string table = " -o '" + folder.path("a.csv") + "'";
    for (const std::string& arguments :
         {"reference '" + folder.path("none.obj") + "'" + picture + light + camera,
          "reference builtin:cornell --quiet --points '" + bad + "'" + table + light,
          "reference builtin:cornell --quiet --points '" + folder.path("none.csv") + "'" + table
              + light,
          "reference builtin:cornell --quiet --spp 2 -o '" + folder.path("no/such/a.exr") + "'"
              + light + camera,
          "compare '" + folder.path("a.exr") + "' '" + folder.path("b.exr") + "'",
          "compare '" + odd + "' '" + odd + "'",
          "compare '" + values + "' '" + more + "'"}) {
        SCOPED_TRACE(arguments);
        expect_failure(run(arguments), 1);
    }
    EXPECT_EQ(folder.count(), 0u);
}

TEST(CommandLine, WritesToADevice) {
    const Outcome made = run("precompute builtin:furnace --coarse-radius 1 --rays 64 --no-verification -o /dev/null --report /dev/null");
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_NE(made.err.find("/dev/null: "), std::string::npos) << made.err;
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(CommandLine, ReferencePictureCarriesItsProvenanceAndEqualsItself) {
    const TemporaryFolder folder;
    const std::string path = folder.path("a.exr");
    const Outcome made = run("reference builtin:cornell --spp 32 --report '" + folder.path("r.json")
                             + "' -o '" + path + "'" + light + camera);
    EXPECT_EQ(made.status, 0) << made.err;
    EXPECT_EQ(made.out, "");
    EXPECT_NE(made.err.find("relative standard error"), std::string::npos);
    const Image image = read_exr(path);
    EXPECT_EQ(image.width, 16);
    EXPECT_EQ(image.height, 12);
    for (const char* name : {"afterglow.version", "afterglow.seed", "afterglow.scene_hash",
                             "afterglow.relative_standard_error"})
        EXPECT_TRUE(image.attributes.contains(name)) << name;
    EXPECT_NE(content_of(folder.path("r.json")).find("\"relative_standard_error\""),
              std::string::npos);

    const Outcome same = run("compare --json '" + path + "' '" + path + "'");
    EXPECT_EQ(same.status, 0) << same.err;
    EXPECT_NE(same.out.find("\"rel_rmse\":0.0"), std::string::npos) << same.out;
    EXPECT_NE(same.out.find("\"reference_standard_error\":"), std::string::npos) << same.out;
    EXPECT_EQ(same.out.find('\n'), same.out.size() - 1);
}

TEST(CommandLine, ReferencePointsAreTheSameOnAnyNumberOfThreads) {
    const TemporaryFolder folder;
    const std::string points =
        folder.write("points.csv", "x,y,z,nx,ny,nz\n0.1,0,0.1,0,1,0\n0.5,0.3,0.559,0,0,-1\n");
    const auto irradiance = [&](const std::string& options) {
        const std::string path = folder.path("e.csv");
        const Outcome made = run("reference builtin:cornell --quiet --points '" + points + "' -o '"
                                 + path + "'" + light + options);
        EXPECT_EQ(made.status, 0) << made.err;
        EXPECT_EQ(made.err, "");
        return content_of(path);
    };
    const std::string one = irradiance(" --spp 64 --threads 1");
    EXPECT_EQ(one, irradiance(" --spp 64 --threads 2"));
    EXPECT_NE(one, irradiance(" --spp 64 --seed 2"));
    EXPECT_EQ(read_irradiance_csv(folder.path("e.csv")).cols(), 2);
}

} // namespace
} // namespace afterglow
