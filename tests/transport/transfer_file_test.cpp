#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "tests/support/file_error.h"
#include "tests/support/small_transfer.h"
#include "tests/support/temporary_folder.h"
#include "transport/positivity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>

namespace afterglow {
namespace {

std::string saved(const TransferOperator& transfer, const TransferProvenance& provenance) {
    const TemporaryFolder folder;
    save_transfer(folder.path("t"), transfer, provenance);
    return content_of(folder.path("t"));
}

const Spotlight lamp{Vec3(0.278f, 0.54f, 0.28f), -Vec3::UnitY(), 25.0f, 35.0f, Rgb(1, 0.5f, 2)};

TEST(TransferFile, SavedLoadedAndSavedAgainItHasTheSameBytes) {
    const TemporaryFolder folder;
    for (const SmallTransfer* small : {&small_transfer(), &small_paper_transfer()}) {
        save_transfer(folder.path("a"), small->transfer, small->provenance);
        const TransferFile loaded = load_transfer(folder.path("a"));
        save_transfer(folder.path("b"), loaded.transfer, loaded.provenance);
        EXPECT_EQ(content_of(folder.path("a")), content_of(folder.path("b")));
        EXPECT_EQ(loaded.transfer.kind, small->options.kind);
        EXPECT_EQ(loaded.transfer.bounces, small->options.bounces);
        EXPECT_EQ(loaded.provenance.scene, "builtin:cornell");
        EXPECT_EQ(loaded.provenance.options, small->provenance.options);
    }
}

TEST(TransferFile, TellsWhatTheLinksOfEachLevelTake) {
    const TemporaryFolder folder;
    const SmallTransfer& small = small_transfer();
    save_transfer(folder.path("a"), small.transfer, small.provenance);
    const TransferFile loaded = load_transfer(folder.path("a"));
    std::uint64_t of_levels = 0, of_tensor = 0;
    for (int l = 0; l < loaded.transfer.points.levels(); ++l) of_levels += loaded.transfer.link_bytes(l);
    for (const auto& [name, bytes] : loaded.tensor_bytes)
        if (name == "links.packed") of_tensor = bytes;
    EXPECT_GT(of_tensor, 0u);
    EXPECT_EQ(of_levels, of_tensor);
}

TEST(TransferFile, TheSameLightComesOutOfTheFile) {
    const TemporaryFolder folder;
    for (const SmallTransfer* small : {&small_transfer(), &small_paper_transfer()}) {
        save_transfer(folder.path("a"), small->transfer, small->provenance);
        const TransferFile loaded = load_transfer(folder.path("a"));
        std::filesystem::remove(folder.path("a")); // what is mapped stays
        const VectorIrradiance before =
            LightTransport(small->transfer, small->surface).indirect(lamp);
        EXPECT_EQ(before, LightTransport(loaded.transfer, small->surface).indirect(lamp));
        EXPECT_GT(*std::max_element(before.begin(), before.end()), 0.0f);
    }
}

TEST(TransferFile, TheNumberOfThreadsDoesNotChangeAByte) {
    for (const SmallTransfer* small : {&small_transfer(), &small_paper_transfer()}) {
        const auto made_with = [&](int threads) {
            const ThreadLimit limit(threads);
            return saved(precompute(small->surface, small->options), small->provenance);
        };
        EXPECT_EQ(made_with(1), made_with(2));
    }
}

TEST(TransferFile, TheNumberOfBouncesIsKeptAndObeyed) {
    const TemporaryFolder folder;
    const SmallTransfer& small = small_transfer();
    TransferOperator transfer = small.transfer;
    const Radiosity direct = LightTransport(transfer, small.surface).direct_radiosity(lamp);
    for (const int bounces : {1, 2}) {
        transfer.bounces = bounces;
        save_transfer(folder.path("a"), transfer, small.provenance);
        const TransferFile loaded = load_transfer(folder.path("a"));
        const LightTransport transport(loaded.transfer, small.surface);
        Radiosity sum = direct;
        if (bounces == 2) {
            const Radiosity second = transport.bounce(direct);
            for (std::size_t i = 0; i < sum.size(); ++i)
                sum[i] += second[i];
        }
        VectorIrradiance expected = transport.gather(sum);
        make_positive(small.transfer.points, small.transfer.push, expected);
        EXPECT_EQ(transport.indirect(lamp), expected);
    }
}

/// One level of points in a row, each the only sender of the one before it.
TransferOperator chain(std::uint32_t count) {
    TransferOperator transfer;
    PointHierarchy& points = transfer.points;
    points.position = Eigen::Matrix3Xf::Zero(3, count);
    points.position.row(0).setLinSpaced(0.0f, 1.0f);
    points.normal = Vec3::UnitY().replicate(1, count);
    points.support = Eigen::VectorXf::Ones(count);
    points.reflectance = Eigen::Matrix3Xf::Constant(3, count, 0.5f);
    points.level_begin = {0, count};
    points.spacing = {1.0f};
    transfer.sender_levels = 1;
    points.parent_level = {-1};
    transfer.pull.children = join_rows(std::vector<std::vector<BasisEntry>>());
    transfer.push.parents = join_rows(std::vector<std::vector<BasisEntry>>(count));
    transfer.sender_areas.assign(count, 1.0f);
    LinkPacker packer;
    std::vector<std::uint64_t> begin{0};
    std::vector<PackedLink> links;
    for (std::uint32_t i = 0; i < count; ++i) {
        std::vector<PackedLink> row;
        if (i + 1 < count) packer.append(i + 1, {0.0f, 0.25f, 0.0f, 0.0f}, row);
        links.insert(links.end(), row.begin(), row.end());
        begin.push_back(links.size());
    }
    transfer.links = {SharedArray(std::move(begin)), SharedArray(std::move(links))};
    return transfer;
}

TEST(TransferFile, ManySendersKeepTheirIndices) {
    const TemporaryFolder folder;
    const TransferOperator transfer = chain(70'000);
    save_transfer(folder.path("a"), transfer, small_transfer().provenance);
    const TransferFile loaded = load_transfer(folder.path("a"));
    ASSERT_EQ(loaded.transfer.links.count(0, 70'000), 69'999u);
    for (std::uint32_t i = 0; i < 69'999; ++i)
        loaded.transfer.links.for_each(i, [&](std::uint32_t sender, const LinkVector& link) {
            ASSERT_EQ(sender, i + 1);
            ASSERT_EQ(link, LinkVector(0.0f, 0.25f, 0.0f, 0.0f));
        });
    EXPECT_EQ(saved(loaded.transfer, loaded.provenance),
              saved(transfer, small_transfer().provenance));
}

TEST(TransferFile, NumPyComputesTheSameProduct) {
    const TemporaryFolder folder;
    const SmallTransfer& small = small_transfer();
    save_transfer(folder.path("t"), small.transfer, small.provenance);
    Radiosity radiosity(3 * small.transfer.senders());
    Rng rng(7, 0);
    for (float& value : radiosity)
        value = rng.uniform();
    folder.write("radiosity", {reinterpret_cast<const char*>(radiosity.data()),
                               radiosity.size() * sizeof(float)});
    const std::string command =
        AFTERGLOW_PYTHON " " AFTERGLOW_TESTS "/transport/apply_with_numpy.py '" + folder.path("t")
        + "' '" + folder.path("radiosity") + "' '" + folder.path("field") + "'";
    ASSERT_EQ(std::system(command.c_str()), 0);
    const std::string bytes = content_of(folder.path("field"));
    const VectorIrradiance expected = LightTransport(small.transfer, small.surface).gather(radiosity);
    ASSERT_EQ(bytes.size(), expected.size() * sizeof(float));
    const float* field = reinterpret_cast<const float*>(bytes.data());
    // Sums of some hundred floats, of which NumPy's are doubles.
    for (std::size_t i = 0; i < expected.size(); ++i)
        ASSERT_NEAR(field[i], expected[i], 2e-5f) << "number " << i;
}

constexpr const char* triangle = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n";

TEST(TransferFile, FindsItsSceneAgainWhenBothAreMovedTogether) {
    const TemporaryFolder folder;
    const std::string obj = folder.write("old/scenes/a.obj", triangle);
    folder.write("old/out/empty", "");
    TransferProvenance provenance = small_transfer().provenance;
    provenance.scene = obj;
    provenance.scene_hash = load_scene(obj).content_hash();
    save_transfer(folder.path("old/out/t"), small_transfer().transfer, provenance);
    std::filesystem::rename(folder.path("old"), folder.path("new"));
    const TransferFile file = load_transfer(folder.path("new/out/t"));
    EXPECT_EQ(load_transfer_scene(folder.path("new/out/t"), file.provenance).triangles.size(), 1u);
}

TEST(TransferFile, AMissingOrAnotherSceneIsOneErrorThatTellsWhatToDo) {
    const TemporaryFolder folder;
    const std::string obj = folder.write("a.obj", triangle);
    TransferProvenance provenance = small_transfer().provenance;
    provenance.scene = obj;
    const std::string hash = load_scene(obj).content_hash();
    const std::string changed = message_of([&] { load_transfer_scene("t", provenance); });
    EXPECT_NE(changed.find(hash), std::string::npos) << changed;
    EXPECT_NE(changed.find(provenance.scene_hash), std::string::npos) << changed;

    provenance.scene_hash = hash;
    EXPECT_NO_THROW(load_transfer_scene("t", provenance));
    EXPECT_THROW(load_transfer_scene("t", provenance, "builtin:cornell"), FileError);
    provenance.scene = folder.path("b.obj");
    const std::string missing = message_of([&] { load_transfer_scene("t", provenance); });
    EXPECT_NE(missing.find("--scene"), std::string::npos) << missing;
    EXPECT_NO_THROW(load_transfer_scene("t", provenance, obj));
    provenance.scene = "builtin:nowhere"; // out of the file: not the user's fault
    EXPECT_NE(message_of([&] { load_transfer_scene("t", provenance); }), "no FileError");
}

} // namespace
} // namespace afterglow
