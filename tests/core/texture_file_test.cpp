#include "core/error.h"
#include "core/image.h"
#include "core/texture_file.h"
#include "tests/support/number_bytes.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>
#include <stb_image_write.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <new>
#include <string>
#include <sys/resource.h>
#include <unistd.h>
#include <vector>

namespace afterglow {
namespace {

using namespace std::string_literals;

/// A chunk of a PNG file; its check sum is not looked at.
std::string chunk(const std::string& type, const std::string& content) {
    return big_endian(static_cast<std::uint32_t>(content.size())) + type + content + "sum "s;
}

/// 2 x 1 texels of colours 0 and 7, of a table that holds one, red.
std::string png_of_few_colours() {
    const std::string texels = "\0\0\7"s; // as they are, no filter
    return "\x89PNG\r\n\x1a\n"s + chunk("IHDR", big_endian(2) + big_endian(1) + "\x08\x03\0\0\0"s)
           + chunk("PLTE", "\xff\0\0"s) + chunk("IDAT", "\x78\x01\x01\x03\0\xfc\xff"s + texels + "sum "s) + chunk("IEND", "");
}

/// The same; `colours` in the table.
std::string bmp_of_few_colours(std::uint32_t colours) {
    std::string table;
    for (std::uint32_t k = 0; k < colours; ++k) table += "\0\0\xff\0"s;
    return "BM"s + little_endian(0) + little_endian(0) + little_endian(54 + 4 * colours) + little_endian(40) + little_endian(2)
           + little_endian(1) + "\x01\0\x08\0"s + std::string(24, '\0') + table + "\0\7\0\0"s;
}

/// Leaves such bytes where the next function finds its own.
[[gnu::noinline]] void soil_stack(unsigned char byte) {
    std::array<volatile unsigned char, 1 << 16> bytes;
    for (volatile unsigned char& b : bytes) b = byte;
}

TEST(TextureFile, ColoursThatItDoesNotHoldAreTheSameEachTime) {
    const TemporaryFolder folder;
    for (const std::string& picture : {png_of_few_colours(), bmp_of_few_colours(1)}) {
        const std::string file = folder.write("picture", picture);
        soil_stack(0x5a);
        const Texture texture = read_texture(file);
        soil_stack(0xa5);
        const Texture again = read_texture(file);
        ASSERT_EQ(texture.width, 2);
        EXPECT_EQ(texture.rgb[0], 1.0f);
        EXPECT_EQ(texture.rgb[1], 0.0f);
        EXPECT_EQ(texture.rgb, again.rgb) << picture.substr(0, 4);
    }
}

/// 1 x 2 texels of 24 bits: the first row in the file is red, the second blue.
std::string bmp_of_two_rows(std::int32_t height) {
    return "BM"s + little_endian(0) + little_endian(0) + little_endian(54) + little_endian(40) + little_endian(1)
           + little_endian(static_cast<std::uint32_t>(height)) + "\x01\0\x18\0"s + std::string(24, '\0') + "\0\0\xff\0\xff\0\0\0"s;
}

TEST(TextureFile, RowsOfABmpComeFromTheBottomOrTheTop) {
    const TemporaryFolder folder;
    const Texture up = read_texture(folder.write("up.bmp", bmp_of_two_rows(2)));
    const Texture down = read_texture(folder.write("down.bmp", bmp_of_two_rows(-2)));
    EXPECT_EQ(up.height, 2);
    EXPECT_EQ(down.height, 2);
    EXPECT_EQ(up.rgb, (std::vector<float>{1, 0, 0, 0, 0, 1})); // row 0 at the bottom
    EXPECT_EQ(down.rgb, (std::vector<float>{0, 0, 1, 1, 0, 0}));
    EXPECT_THROW(read_texture(folder.write("none.bmp", bmp_of_two_rows(std::numeric_limits<std::int32_t>::min()))), FileError);
}

TEST(TextureFile, WhatACameraPutsBehindAJpegPictureIsPassedOver) {
    const TemporaryFolder folder;
    std::string picture;
    const std::vector<unsigned char> grey(3 * 16 * 16, 128);
    stbi_write_jpg_to_func(
        [](void* to, void* data, int size) {
            static_cast<std::string*>(to)->append(static_cast<const char*>(data), static_cast<std::size_t>(size));
        },
        &picture, 16, 16, 3, grey.data(), 90);
    const Texture alone = read_texture(folder.write("a.jpg", picture));
    // What looks like a table of more codes than there are: in the picture it would be refused.
    const std::string table = "\xff\xc4\x01\x00\x00"s + std::string(16, '\xff');
    const Texture with_more = read_texture(folder.write("b.jpg", picture + table));
    EXPECT_EQ(with_more.rgb, alone.rgb);
    ASSERT_EQ(picture.substr(picture.size() - 2), "\xff\xd9");
    picture.insert(picture.size() - 2, table);
    EXPECT_THROW(read_texture(folder.write("c.jpg", picture)), FileError);
}

#ifndef AFTERGLOW_SANITIZED // which takes all addresses there are
/// Reads a file with `bytes` of memory more than there are, and ends the process: status 3 for want of memory.
[[noreturn]] void read_within(rlim_t bytes, const std::string& file) {
    std::ifstream statm("/proc/self/statm");
    rlim_t pages = 0;
    statm >> pages;
    const rlim_t most = pages * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + bytes;
    const rlimit limit = {most, most};
    ::setrlimit(RLIMIT_AS, &limit);
    try {
        read_texture(file);
    } catch (const std::bad_alloc&) {
        std::_Exit(3);
    } catch (const std::exception&) {
        std::_Exit(4);
    }
    std::_Exit(5);
}

TEST(TextureFile, WantOfMemoryIsNotTakenForADamagedFile) {
    const TemporaryFolder folder;
    const std::string file = folder.path("large.png"); // whose bytes alone are 50 MB
    write_png_bytes(file, 4096, 4096, std::vector<unsigned char>(3 * 4096 * 4096, 0));
    EXPECT_EXIT(read_within(rlim_t{16} << 20, file), ::testing::ExitedWithCode(3), "");
    EXPECT_EXIT(read_within(rlim_t{2} << 30, file), ::testing::ExitedWithCode(5), "");
}
#endif

TEST(TextureFile, AColourTableMustBeThere) {
    const TemporaryFolder folder;
    std::string none = bmp_of_few_colours(0);
    EXPECT_THROW(read_texture(folder.write("none.bmp", none)), FileError);
    none[10] = 8; // so that texels lie before it
    EXPECT_THROW(read_texture(folder.write("less.bmp", none)), FileError);
    EXPECT_NO_THROW(read_texture(folder.write("some.bmp", bmp_of_few_colours(8))));
}

} // namespace
} // namespace afterglow
