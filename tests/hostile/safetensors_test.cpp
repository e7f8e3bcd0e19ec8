#include "core/error.h"
#include "tests/support/allocation_watch.h"
#include "tests/support/file_error.h"
#include "tests/support/temporary_folder.h"
#include "transport/safetensors.h"

#include <gtest/gtest.h>

#include <cstring>

namespace afterglow {
namespace {

/// A small file with two tensors and the padding between them.
std::string small_container() {
    const TemporaryFolder folder;
    const std::vector<float> position = {1.0f, 2.0f, 3.0f};
    const std::vector<std::uint16_t> index = {4, 5};
    const std::vector<Tensor> tensors = {make_tensor<float>("position", {1, 3}, position),
                                         make_tensor<std::uint16_t>("index", {2}, index)};
    write_safetensors(folder.path("a"), tensors, {{"scene", "a.obj"}, {"seed", "1"}});
    return content_of(folder.path("a"));
}

/// "accepted", or what the one line of the FileError says.
std::string open(const TemporaryFolder& folder, const std::string& bytes) {
    folder.write("a", bytes);
    return refusal_of([&] { const SafetensorsFile file(folder.path("a")); });
}

/// A file with these entries after the metadata whose checksums are right, whatever it claims.
std::string forge(const std::string& entries, const std::string& data,
                  const std::string& metadata = "") {
    std::string header = "01234567{\"__metadata__\":{" + metadata + "\"checksum\":\""
                         + hash_hex(std::as_bytes(std::span(data))) + "\",\"header_checksum\":\"";
    const std::size_t digits = header.size();
    header += std::string(32, '0') + "\"}" + entries + "}";
    header.resize((header.size() + 63) / 64 * 64, ' ');
    const std::uint64_t length = header.size() - sizeof(length);
    std::memcpy(header.data(), &length, sizeof(length));
    header.replace(digits, 32, hash_hex(std::as_bytes(std::span(header))));
    return header + data;
}

std::string entry(const std::string& name, const std::string& dtype, const std::string& shape,
                  const std::string& offsets) {
    return ",\"" + name + "\":{\"dtype\":\"" + dtype + "\",\"shape\":" + shape
           + ",\"data_offsets\":" + offsets + "}";
}

TEST(HostileSafetensors, EveryTruncationIsAnError) {
    const TemporaryFolder folder;
    const std::string good = small_container();
    ASSERT_EQ(open(folder, good), "accepted");
    for (std::size_t length = 0; length < good.size(); ++length)
        EXPECT_NE(open(folder, good.substr(0, length)), "accepted") << length << " bytes";
}

TEST(HostileSafetensors, AnythingAppendedIsAnError) {
    const TemporaryFolder folder;
    for (const std::size_t count : {1u, 64u, 4096u})
        EXPECT_NE(open(folder, small_container() + std::string(count, '\0')), "accepted");
}

TEST(HostileSafetensors, EverySingleFlippedBitIsAnError) {
    const TemporaryFolder folder;
    const std::string good = small_container();
    for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
        std::string bad = good;
        bad[bit / 8] = static_cast<char>(bad[bit / 8] ^ (1 << bit % 8));
        EXPECT_NE(open(folder, bad), "accepted") << "bit " << bit % 8 << " of byte " << bit / 8;
    }
}

TEST(HostileSafetensors, AFolderAMissingFileAndOtherFormatsAreErrors) {
    const TemporaryFolder folder;
    EXPECT_THROW(SafetensorsFile(folder.path(".")), FileError);
    EXPECT_THROW(SafetensorsFile(folder.path("missing")), FileError);
    EXPECT_NE(open(folder, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "accepted");
    EXPECT_NE(open(folder, std::string(1000, '\0')), "accepted");
}

TEST(HostileSafetensors, AForgedHeaderIsCheckedThoughItsChecksumsAreRight) {
    const std::string data(128, 'x');
    const std::string whole = entry("a", "U8", "[128]", "[0,128]");
    const TemporaryFolder folder;
    ASSERT_EQ(open(folder, forge(whole, data)), "accepted");

    const auto two = [&](const std::string& first, const std::string& second) {
        return entry("a", "U8", "[64]", first) + entry("b", "U8", "[64]", second);
    };
    ASSERT_EQ(open(folder, forge(two("[0,64]", "[64,128]"), data)), "accepted");
    const std::map<std::string, std::string> bad = {
        {"overlap", two("[0,64]", "[0,64]")},
        {"hole", entry("a", "U8", "[32]", "[0,32]") + entry("b", "U8", "[64]", "[64,128]")},
        {"descending", two("[64,128]", "[0,64]")},
        {"end before begin",
         entry("a", "U8", "[128]", "[0,128]") + entry("b", "U8", "[0]", "[128,0]")},
        {"outside", entry("a", "U8", "[129]", "[0,129]")},
        {"far outside", entry("a", "U8", "[18446744073709551615]", "[0,18446744073709551615]")},
        {"not covered", entry("a", "U8", "[64]", "[0,64]")},
        {"unaligned", entry("a", "U8", "[32]", "[0,32]") + entry("b", "U8", "[96]", "[32,128]")},
        {"shape against bytes", entry("a", "F32", "[128]", "[0,128]")},
        {"overflow", entry("a", "U64", "[2305843009213693968]", "[0,128]")},
        {"overflow of a product", entry("a", "U8", "[4294967296,4294967296,128]", "[0,128]")},
        {"unknown dtype", entry("a", "F64", "[16]", "[0,128]")},
        {"negative extent", entry("a", "U8", "[-128]", "[0,128]")},
        {"fractional extent", entry("a", "U8", "[128.0]", "[0,128]")},
        {"extent beyond 64 bits", entry("a", "U8", "[18446744073709551744]", "[0,128]")},
        {"shape of text", entry("a", "U8", "\"128\"", "[0,128]")},
        {"rank", entry("a", "U8", "[1,1,1,1,1,1,1,1,128]", "[0,128]")},
        {"one offset", entry("a", "U8", "[128]", "[128]")},
        {"nested shape", entry("a", "U8", "[[128]]", "[0,128]")},
        {"same name twice",
         entry("a", "U8", "[64]", "[0,64]") + entry("a", "U8", "[64]", "[64,128]")},
        {"entry is no object", whole + ",\"b\":3"},
        {"key too many",
         ",\"a\":{\"dtype\":\"U8\",\"shape\":[128],\"data_offsets\":[0,128],\"x\":1}"},
        {"key missing", ",\"a\":{\"dtype\":\"U8\",\"shape\":[128]}"},
        {"text after the header", whole + "} {"},
        {"control character in a name", entry("a\\u000a", "U8", "[1]", "[0,128]")},
        {"not UTF-8", entry("\xff", "U8", "[128]", "[0,128]")},
    };
    for (const auto& [what, entries] : bad)
        EXPECT_NE(open(folder, forge(entries, data)), "accepted") << what;
    EXPECT_NE(open(folder, forge(whole, data, "\"seed\":1,")), "accepted") << "metadata number";
    EXPECT_NE(open(folder, forge(whole, data, "\"seed\":{},")), "accepted") << "metadata object";
    EXPECT_NE(open(folder, forge(whole, data, "\"a\":\"\",\"a\":\"\",")), "accepted")
        << "key twice";
}

TEST(HostileSafetensors, AbsurdSizesAreRefusedBeforeAnythingLargeIsAllocated) {
    const TemporaryFolder folder;
    std::string nested(500000, '[');
    std::string names;
    for (int i = 0; i < 50000; ++i)
        names += ",\"" + std::to_string(i) + "\":0";
    std::string length_only = small_container();
    for (const std::uint64_t length :
         {std::uint64_t(1) << 20, std::uint64_t(1) << 40, ~std::uint64_t(0), ~std::uint64_t(7)}) {
        std::memcpy(length_only.data(), &length, sizeof(length));
        folder.write("a", length_only);
        watch_allocations();
        EXPECT_THROW(SafetensorsFile(folder.path("a")), FileError);
        EXPECT_LT(largest_allocation(), 4096u) << length;
    }
    for (const std::string& entries :
         {entry("a", "F32", "[1000000000000]", "[0,4000000000000]"), ",\"a\":" + nested, names}) {
        folder.write("a", forge(entries, ""));
        watch_allocations();
        EXPECT_THROW(SafetensorsFile(folder.path("a")), FileError);
        EXPECT_LT(largest_allocation(), std::size_t(4) << 20) << entries.substr(0, 40);
    }
}

} // namespace
} // namespace afterglow
