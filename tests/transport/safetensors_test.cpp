#include "core/error.h"
#include "tests/support/file_error.h"
#include "tests/support/temporary_folder.h"
#include "transport/safetensors.h"

#include <gtest/gtest.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <numeric>
#include <sys/resource.h>

namespace afterglow {
namespace {

/// One tensor of every type, among them an empty one and a single number.
struct Sample {
    std::vector<float> f32 = {0.5f, -1.25f, 3e38f, 1e-40f, -0.0f, 2.0f};
    std::vector<Eigen::half> f16 = {Eigen::half(1.5f), Eigen::half(-2.0f), Eigen::half(65504.0f)};
    std::vector<std::uint64_t> u64 = {1, ~std::uint64_t(0) >> 12};
    std::vector<std::uint32_t> u32 = std::vector<std::uint32_t>(40, 7);
    std::vector<std::uint16_t> u16 = {65535};
    std::vector<std::uint8_t> u8 = {0, 255, 3};
    std::vector<std::int8_t> i8 = {-128, 127};

    std::vector<Tensor> tensors() const {
        return {make_tensor<float>("points.position", {2, 3}, f32),
                make_tensor<Eigen::half>("links.value", {3}, f16),
                make_tensor<std::uint64_t>("links.begin", {2}, u64),
                make_tensor<std::uint32_t>("links.index", {40}, u32),
                make_tensor<std::uint16_t>("number", {}, u16),
                make_tensor<float>("nothing", {0, 3}, std::span<const float>()),
                make_tensor<std::uint8_t>("bytes", {1, 1, 3}, u8),
                make_tensor<std::int8_t>("signed bytes", {2}, i8)};
    }
    TensorMetadata metadata = {{"seed", "42"},
                               {"scene", "../sc\"en\\e \xc3\xa4.obj"},
                               {"note", "\"header_checksum\":\"0123"}};
};

template <class T>
std::vector<T> values(const SafetensorsFile& file, const std::string& name, TensorShape shape) {
    const auto span = file.tensor<T>(name, shape);
    return {span.begin(), span.end()};
}

TEST(Safetensors, RoundTripKeepsEveryTypeAndString) {
    const TemporaryFolder folder;
    const Sample sample;
    write_safetensors(folder.path("a"), sample.tensors(), sample.metadata);
    const SafetensorsFile file(folder.path("a"));

    EXPECT_EQ(file.metadata(), sample.metadata);
    EXPECT_EQ(file.metadata("seed"), "42");
    EXPECT_EQ(values<float>(file, "points.position", {2, 3}), sample.f32);
    EXPECT_EQ(values<Eigen::half>(file, "links.value", {3}), sample.f16);
    EXPECT_EQ(values<std::uint64_t>(file, "links.begin", {2}), sample.u64);
    EXPECT_EQ(values<std::uint32_t>(file, "links.index", {any_extent}), sample.u32);
    EXPECT_EQ(values<std::uint16_t>(file, "number", {}), sample.u16);
    EXPECT_TRUE(file.tensor<float>("nothing", {any_extent, 3}).empty());
    EXPECT_EQ(values<std::uint8_t>(file, "bytes", {1, 1, 3}), sample.u8);
    EXPECT_EQ(values<std::int8_t>(file, "signed bytes", {2}), sample.i8);

    const auto written = sample.tensors();
    ASSERT_EQ(file.tensors().size(), written.size());
    for (std::size_t i = 0; i < written.size(); ++i) {
        EXPECT_EQ(file.tensors()[i].name, written[i].name);
        EXPECT_EQ(file.tensors()[i].dtype, written[i].dtype);
        EXPECT_EQ(file.tensors()[i].shape, written[i].shape);
        const auto address = reinterpret_cast<std::uintptr_t>(file.tensors()[i].bytes.data());
        EXPECT_EQ(address % 64, 0u) << written[i].name;
    }
}

TEST(Safetensors, AFileMayHoldNothing) {
    const TemporaryFolder folder;
    write_safetensors(folder.path("a"), {}, {});
    const SafetensorsFile file(folder.path("a"));
    EXPECT_TRUE(file.tensors().empty());
    EXPECT_TRUE(file.metadata().empty());
}

TEST(Safetensors, TheSameArgumentsGiveTheSameBytes) {
    const TemporaryFolder folder;
    write_safetensors(folder.path("a"), Sample().tensors(), Sample().metadata);
    write_safetensors(folder.path("b"), Sample().tensors(), Sample().metadata);
    EXPECT_EQ(content_of(folder.path("a")), content_of(folder.path("b")));
}

TEST(Safetensors, SpansOutliveTheFileObjectWhileTheMapIsHeld) {
    const TemporaryFolder folder;
    const Sample sample;
    write_safetensors(folder.path("a"), sample.tensors(), {});
    std::shared_ptr<const MappedFile> map;
    std::span<const std::uint32_t> index;
    {
        const SafetensorsFile file(folder.path("a"));
        map = file.map();
        index = file.tensor<std::uint32_t>("links.index", {40});
    }
    EXPECT_EQ(std::accumulate(index.begin(), index.end(), 0u), 280u);
}

TEST(Safetensors, AnErrorNamesFileTensorAndWhatWasExpected) {
    const TemporaryFolder folder;
    const Sample sample;
    write_safetensors(folder.path("a"), sample.tensors(), sample.metadata);
    const SafetensorsFile file(folder.path("a"));
    EXPECT_EQ(message_of([&] {
                  file.tensor<float>("points.normal", {any_extent, 3});
              }),
              folder.path("a")
                  + ": has no tensor 'points.normal' F32 [any, 3]; run precompute again");
    EXPECT_EQ(message_of([&] {
                  file.tensor<Eigen::half>("points.position", {2, 4});
              }),
              folder.path("a")
                  + ": should hold tensor 'points.position' F16 [2, 4], but holds F32 [2, 3]; run "
                    "precompute again");
    EXPECT_EQ(message_of([&] { file.metadata("options"); }),
              folder.path("a") + ": has no metadata 'options'; run precompute again");
}

TEST(Safetensors, AStringThatIsNotUtf8IsRefusedAndNothingIsWritten) {
    const TemporaryFolder folder;
    EXPECT_THROW(write_safetensors(folder.path("a"), {}, {{"scene", "\xe4.obj"}}), FileError);
    EXPECT_EQ(folder.count(), 0u);
}

TEST(Safetensors, AFullDiskIsOneErrorAndLeavesTheOldFile) {
    const TemporaryFolder folder;
    const std::vector<float> many(1 << 20);
    write_safetensors(folder.path("a"), {}, {{"which", "old"}});

    // The file size limit fails write(2) just as a full disk does, halfway through the tensor.
    rlimit unlimited = {};
    getrlimit(RLIMIT_FSIZE, &unlimited);
    const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limited = {1 << 21, unlimited.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limited);
    const std::array tensors = {make_tensor<float>("many", {many.size()}, many)};
    const std::string message = message_of([&] {
        write_safetensors(folder.path("a"), tensors, {{"which", "new"}});
    });
    setrlimit(RLIMIT_FSIZE, &unlimited);
    std::signal(SIGXFSZ, old_handler);

    EXPECT_TRUE(message.starts_with(folder.path("a") + ": cannot be written: ")) << message;
    EXPECT_EQ(SafetensorsFile(folder.path("a")).metadata("which"), "old");
    std::filesystem::remove(folder.path("a"));
    EXPECT_EQ(folder.count(), 0u);
}

TEST(Safetensors, AFullDeviceIsAnError) {
    EXPECT_EQ(message_of([] { write_safetensors("/dev/full", {}, {}); }),
              "/dev/full: cannot be written: No space left on device; free some space or choose "
              "another folder");
}

TEST(Safetensors, OpensInPlainNumPy) {
    const TemporaryFolder folder;
    const Sample sample;
    auto tensors = sample.tensors();
    const std::vector<float> simple = {0.5f, 1.0f, 2.0f, 4.0f, 8.0f, 16.0f};
    tensors[0] = make_tensor<float>("points.position", {2, 3}, simple);
    write_safetensors(folder.path("a"), tensors, sample.metadata);

    const std::string command = AFTERGLOW_PYTHON " " AFTERGLOW_TESTS
                                                 "/transport/open_with_numpy.py "
                                + folder.path("a") + " > " + folder.path("out");
    ASSERT_EQ(std::system(command.c_str()), 0);
    EXPECT_EQ(content_of(folder.path("out")), "seed 42\n"
                                              "points.position float32 2 3 31.5\n"
                                              "links.value float16 3 65503.5\n"
                                              "links.begin uint64 2 4503599627370496.0\n"
                                              "links.index uint32 40 280.0\n"
                                              "number uint16 65535.0\n"
                                              "nothing float32 0 3 0.0\n"
                                              "bytes uint8 1 1 3 258.0\n"
                                              "signed bytes int8 2 -1.0\n");
}

} // namespace
} // namespace afterglow
