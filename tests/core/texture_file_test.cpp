#include "core/error.h"
#include "core/texture_file.h"
#include "tests/support/number_bytes.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>

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
