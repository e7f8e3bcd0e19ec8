#include "core/image.h"
#include "core/obj_loader.h"
#include "tests/support/allocation_watch.h"
#include "tests/support/file_error.h"
#include "tests/support/number_bytes.h"
#include "tests/support/temporary_folder.h"
#include "transport/csv_points.h"
#include "transport/transfer_file.h"

#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <vector>

namespace afterglow {
namespace {

constexpr std::size_t some_megabytes = std::size_t(4) << 20;

/// A file of 200 bytes that starts like this.
std::string padded(const std::string& start) {
    std::string bytes(200, 'x');
    start.copy(bytes.data(), bytes.size());
    return bytes;
}

/// Pictures of which the header, all that there is, promises `side` times `side` texels.
std::map<std::string, std::string> pictures_of(std::uint32_t side) {
    using namespace std::string_literals;
    const std::string number = std::to_string(side);
    const std::string half = {static_cast<char>(side), static_cast<char>(side >> 8)};
    const std::string half_swapped = {half[1], half[0]};
    return {
        {"png", "\x89PNG\r\n\x1a\n"s + big_endian(13) + "IHDR" + big_endian(side) + big_endian(side)
                    + "\x08\x02\0\0\0"s + "crc " + big_endian(99) + "IDAT"},
        {"bmp", "BM"s + little_endian(200) + little_endian(0) + little_endian(54) + little_endian(40)
                    + little_endian(side) + little_endian(side) + "\x01\0\x18\0"s + std::string(24, '\0')},
        {"tga", "\0\0\x0a\0\0\0\0\0\0\0\0\0"s + half + half + "\x18\0"s},
        {"gif", "GIF89a" + half + half + "\xf0\0\0"s + std::string(6, 'c') + ",\0\0\0\0"s + half + half + "\0\x02"s},
        {"ppm", "P6\n" + number + " " + number + "\n255\n"},
        {"hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + number + " +X " + number + "\n"},
        {"psd", "8BPS\0\x01"s + std::string(6, '\0') + "\0\x03"s + big_endian(side) + big_endian(side)
                    + "\0\x08\0\x03"s + std::string(14, '\0')},
        {"jpg", "\xff\xd8\xff\xc0\0\x11\x08"s + half_swapped + half_swapped
                    + "\x03\x01\x11\0\x02\x11\0\x03\x11\0"s},
    };
}

TEST(HostileSizes, APictureCannotClaimMoreTexelsThanItsFileCanHold) {
    const TemporaryFolder folder;
    const std::string obj = folder.write(
        "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    for (const auto& [format, start] : pictures_of(8000)) {
        folder.write("a.mtl", "newmtl a\nmap_Kd a." + format + "\nmap_Bump a." + format + "\n");
        folder.write("a." + format, padded(start));
        watch_allocations();
        const Scene scene = load_obj(obj);
        EXPECT_LT(largest_allocation(), some_megabytes) << format;
        EXPECT_TRUE(scene.textures.empty()) << format;
        EXPECT_EQ(scene.summary.missing_files.size(), 2u) << format;
    }
}

/// A small OpenEXR file with other numbers in its header.
std::string exr_with(const std::string& from, const std::string& to) {
    const TemporaryFolder folder;
    write_image(folder.path("a.exr"), Image(4, 4), PixelType::half_float);
    std::string bytes = content_of(folder.path("a.exr"));
    const std::size_t place = bytes.find(from);
    EXPECT_NE(place, std::string::npos);
    return bytes.replace(place, to.size(), to);
}

TEST(HostileSizes, AnExrAttributeHasWholeFloats) {
    // The library would leave two bytes of six unread, take them for the next attribute's name and what
    // follows for its size.
    const TemporaryFolder folder;
    write_image(folder.path("a.exr"), Image(4, 4), PixelType::half_float);
    const std::string whole = content_of(folder.path("a.exr"));
    for (const std::uint32_t bytes : {4u, 6u, 7u, 8u}) {
        const std::string type("floatvector", 12), value("\0\0\0\0b\0\0\0", bytes);
        std::string damaged = whole;
        damaged.insert(8, std::string("a\0", 2) + type + little_endian(bytes) + value);
        folder.write("b.exr", damaged);
        watch_allocations();
        const std::string refusal = refusal_of([&] { read_exr(folder.path("b.exr")); });
        EXPECT_LT(largest_allocation(), some_megabytes) << bytes;
        EXPECT_EQ(refusal.find("damaged OpenEXR header") != std::string::npos, bytes % 4 != 0) << bytes << ": " << refusal;
    }
}

TEST(HostileSizes, AnExrHeaderIsJudgedBeforeTheLibraryAllocatesByIt) {
    const std::string window = std::string("box2i") + std::string(1, '\0') + little_endian(16);
    const auto sized = [&](std::uint32_t width, std::uint32_t height) {
        return exr_with(window, window + std::string(8, '\0') + little_endian(width - 1)
                                    + little_endian(height - 1));
    };
    const TemporaryFolder folder;
    for (const auto& [width, height] : {std::pair(60000u, 2000u), {60000u, 60000u}, {60000u, 1u}, {1u, 60000u},
                                        {2000000000u, 2000000000u}, {0u, 4u}, {1u << 31, 1u << 31}}) {
        folder.write("a.exr", sized(width, height));
        watch_allocations();
        EXPECT_NE(refusal_of([&] { read_exr(folder.path("a.exr")); }), "accepted") << width << " x " << height;
        EXPECT_LT(largest_allocation(), some_megabytes) << width << " x " << height;
    }
    EXPECT_EQ(refusal_of([&] { read_exr(folder.write("a.exr", sized(4, 4))); }), "accepted");
}

TEST(HostileSizes, ABlackPictureIsNotTakenForOne) {
    // The bound on pixels per byte must not refuse what our own writer makes.
    const TemporaryFolder folder;
    write_image(folder.path("a.exr"), Image(3840, 2160), PixelType::half_float);
    EXPECT_EQ(read_exr(folder.path("a.exr")).width, 3840);
    // One colour is what PNG packs best.
    write_png_bytes(folder.path("a.png"), 2048, 2048, std::vector<unsigned char>(3 * 2048 * 2048, 255));
    folder.write("a.mtl", "newmtl a\nmap_Kd a.png\n");
    const Scene scene = load_obj(folder.write(
        "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"));
    EXPECT_EQ(scene.textures.size(), 1u);
}

TEST(HostileSizes, TextOfTwoHundredBytesStaysSmall) {
    const TemporaryFolder folder;
    const std::string digits(150, '9');
    const std::map<std::string, std::function<void(const std::string&)>> readers = {
        {"obj", [](const std::string& path) { load_obj(path); }},
        {"csv", [](const std::string& path) { read_points_csv(path); }},
        {"transfer", [](const std::string& path) { load_transfer(path); }},
    };
    const std::vector<std::string> texts = {
        "v 0 0 0\nf " + digits + " 1 2\n", "v " + digits + "\nf 1 1 1\n",
        "f -999999999/999999999/999999999 2 3\n", digits + "," + digits + "\n",
        std::string("\x00\x00\x10\x00\x00\x00\x00\x00{", 9)};
    for (const std::string& text : texts)
        for (const auto& reader : readers) {
            const std::string& format = reader.first;
            const std::string path = folder.write("a." + format, padded(text));
            watch_allocations();
            EXPECT_NE(refusal_of([&] { reader.second(path); }), "accepted") << format << ": " << text;
            EXPECT_LT(largest_allocation(), some_megabytes) << format << ": " << text;
        }
}

} // namespace
} // namespace afterglow
