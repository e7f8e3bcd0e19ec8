#include "core/error.h"
#include "tests/support/small_transfer.h"
#include "tests/support/temporary_folder.h"
#include "transport/checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

namespace afterglow {
namespace {

struct Stopped {};

/// The Cornell box, of which the links are made in half a dozen batches.
PrecomputeOptions in_batches() {
    PrecomputeOptions options = small_options();
    options.coarse_radius = 0.06f;
    options.links.rays = 512;
    return options;
}

class Checkpoints : public ::testing::Test {
protected:
    const TransferProvenance asked = {AFTERGLOW_VERSION, "builtin:cornell", small_transfer().scene.content_hash(), 1,
                                      "{\"rays\":64}"};
    TemporaryFolder folder;
    std::string path = folder.path("checkpoint");

    /// Leaves a checkpoint behind, from the last batch before a share of the work was done.
    void stop_at(double moment) {
        Checkpoint checkpoint(path, asked, 0.0);
        PrecomputeOptions options = in_batches();
        options.checkpoint = &checkpoint;
        options.progress = [&](double share) {
            if (share > moment) throw Stopped();
        };
        EXPECT_THROW(precompute(small_transfer().surface, options), Stopped);
    }

    std::string finish(Checkpoint* checkpoint) {
        PrecomputeOptions options = in_batches();
        options.checkpoint = checkpoint;
        PrecomputeReport report;
        TransferProvenance provenance = asked;
        const TransferOperator transfer = precompute(small_transfer().surface, options, &report);
        provenance.statistics = "{\"rays\": " + std::to_string(report.links.rays) + ", \"before\": "
                                + std::to_string(report.links.links_before) + ", \"patches\": "
                                + std::to_string(report.links.patches) + ", \"points_rays\": "
                                + std::to_string(report.points_rays) + "}";
        save_transfer(folder.path("t"), transfer, provenance);
        return content_of(folder.path("t"));
    }

    void expect_refusal(const TransferProvenance& other, const std::string& words) {
        try {
            Checkpoint(path, other, 0.0);
            ADD_FAILURE() << "accepted";
        } catch (const Error& error) {
            EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
            EXPECT_NE(std::string(error.what()).find("--checkpoint"), std::string::npos) << error.what();
        }
    }
};

TEST_F(Checkpoints, GoOnToTheSameBytesAndCountsFromAnywhere) {
    const std::string undisturbed = finish(nullptr);
    std::uint32_t done_before = 0;
    for (const double moment : {0.4, 0.6, 0.8}) { // each goes on from the one before
        stop_at(moment);
        Checkpoint checkpoint(path, asked, 0.0);
        ASSERT_TRUE(checkpoint.found());
        EXPECT_GT(checkpoint.found()->done, done_before);
        done_before = checkpoint.found()->done;
    }
    Checkpoint checkpoint(path, asked, 0.0);
    EXPECT_LT(checkpoint.found()->done, checkpoint.found()->transfer.points.size());
    EXPECT_EQ(finish(&checkpoint), undisturbed);
    checkpoint.remove();
    EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(Checkpoints, OfAnythingElseAreRefused) {
    stop_at(0.5);
    TransferProvenance other = asked;
    other.version = "0.0.0";
    expect_refusal(other, "another version");
    other = asked;
    other.scene_hash = std::string(32, '0');
    expect_refusal(other, "another scene");
    other = asked;
    other.seed = 2;
    expect_refusal(other, "another seed");
    other = asked;
    other.options = "{\"rays\":128}";
    expect_refusal(other, "another precomputation");
    EXPECT_THROW(load_transfer(path), FileError) << "a checkpoint is no transfer file";
}

TEST_F(Checkpoints, ThatAreDamagedAreRefused) {
    stop_at(0.5);
    const std::string whole = content_of(path);
    for (const std::size_t at : {std::size_t{0}, std::size_t{100}, whole.size() / 2, whole.size() - 1}) {
        std::string damaged = whole;
        damaged[at] ^= 1;
        folder.write("checkpoint", damaged);
        expect_refusal(asked, path);
    }
    for (const std::size_t length : {std::size_t{0}, std::size_t{7}, whole.size() / 2, whole.size() - 1}) {
        folder.write("checkpoint", whole.substr(0, length));
        expect_refusal(asked, path);
    }
    save_transfer(path, small_transfer().transfer, asked);
    expect_refusal(asked, "no file of the format");
}

TEST_F(Checkpoints, OfAFinerStepOutliveTheCoarserOnes) {
    stop_at(0.5); // of coarse_scale 1
    const std::string kept = content_of(path);
    Checkpoint checkpoint(path, asked, 0.0);
    EXPECT_FALSE(checkpoint.take(4.0f));
    EXPECT_FALSE(checkpoint.is_due());
    checkpoint.save(small_transfer().transfer, 0, {}, PrecomputeReport());
    EXPECT_EQ(content_of(path), kept);
    EXPECT_TRUE(checkpoint.take(1.0f));

    Checkpoint again(path, asked, 0.0);
    EXPECT_FALSE(again.take(0.5f)) << "of a coarser step";
    EXPECT_TRUE(again.is_due());
}

} // namespace
} // namespace afterglow
