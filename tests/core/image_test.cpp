#include "core/error.h"
#include "core/exr_header.h"
#include "core/image.h"
#include "core/sampling.h"
#include "tests/support/temporary_folder.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStdIO.h>
#include <ImfTileDescription.h>
#include <ImfTiledOutputFile.h>
#include <gtest/gtest.h>
#include <stb_image.h>

#include <cmath>
#include <half.h>
#include <limits>
#include <memory>

namespace afterglow {
namespace {

Image noise(int width, int height) {
    Image image(width, height);
    Rng rng(1, 0);
    for (float& x : image.rgb)
        x = std::exp(8.0f * rng.uniform() - 4.0f);
    image.attributes = {{"seed", "7"}, {"afterglow.options", "--rays 64"}, {"empty", ""}};
    return image;
}

struct Png {
    int width = 0, height = 0;
    std::vector<unsigned char> rgb;
};

Png read_png(const std::string& path) {
    Png png;
    int channels = 0;
    const std::unique_ptr<stbi_uc, void (*)(void*)> data(
        stbi_load(path.c_str(), &png.width, &png.height, &channels, 3), stbi_image_free);
    if (data) png.rgb.assign(data.get(), data.get() + 3 * png.width * png.height);
    return png;
}

TEST(Exr, GivesFloatsAndAttributesBackUnchanged) {
    const TemporaryFolder folder;
    Image image = noise(37, 21);
    image.rgb[5] = -3.0f;
    image.rgb[6] = std::numeric_limits<float>::infinity();
    write_image(folder.path("a.exr"), image, PixelType::full_float);
    const Image back = read_exr(folder.path("a.exr"));
    EXPECT_EQ(back.width, 37);
    EXPECT_EQ(back.height, 21);
    EXPECT_EQ(back.rgb, image.rgb);
    EXPECT_EQ(back.attributes, image.attributes);
    EXPECT_EQ(folder.count(), 1u);
}

TEST(Exr, RoundsToHalfAndClampsToItsRange) {
    const TemporaryFolder folder;
    Image image = noise(16, 9);
    image.rgb[0] = 1e9f;
    write_image(folder.path("a.exr"), image, PixelType::half_float);
    const Image back = read_exr(folder.path("a.exr"));
    EXPECT_EQ(back.rgb[0], 65504.0f);
    for (std::size_t i = 1; i < image.rgb.size(); ++i)
        EXPECT_EQ(back.rgb[i], static_cast<float>(half(image.rgb[i])));
}

TEST(Exr, HasTheSameBytesEachTime) {
    const TemporaryFolder folder;
    write_image(folder.path("a.exr"), noise(64, 64), PixelType::half_float);
    write_image(folder.path("b.exr"), noise(64, 64), PixelType::half_float);
    EXPECT_EQ(content_of(folder.path("a.exr")), content_of(folder.path("b.exr")));
}

TEST(Exr, TellsOfFilesThatAreMissingForeignOrCutShort) {
    const TemporaryFolder folder;
    write_image(folder.path("a.exr"), noise(64, 64), PixelType::full_float);
    const std::string whole = content_of(folder.path("a.exr"));
    EXPECT_THROW(read_exr(folder.path("none.exr")), FileError);
    EXPECT_THROW(read_exr(folder.path("")), FileError);
    EXPECT_THROW(read_exr(folder.write("empty.exr", "")), FileError);
    EXPECT_THROW(read_exr(folder.write("text.exr", "no picture at all")), FileError);
    for (const double share : {0.01, 0.1, 0.5, 0.9, 0.999})
        EXPECT_THROW(read_exr(folder.write(
                         "cut.exr",
                         whole.substr(0, static_cast<std::size_t>(share * double(whole.size()))))),
                     FileError)
            << share;
}

TEST(Exr, SurvivesEveryDamagedByteOfItsHeader) {
    const TemporaryFolder folder;
    write_image(folder.path("a.exr"), noise(8, 8), PixelType::half_float);
    const std::string whole = content_of(folder.path("a.exr"));
    for (std::size_t i = 0; i < std::min<std::size_t>(whole.size(), 600); ++i) {
        std::string damaged = whole;
        damaged[i] = static_cast<char>(damaged[i] ^ 0x81);
        try {
            read_exr(folder.write("damaged.exr", damaged));
        } catch (const FileError&) { // most damage is noticed; none may do worse
        }
    }
}

TEST(Png, IsWellFormedAndHasItsFirstRowOnTop) {
    const TemporaryFolder folder;
    Image image(5, 3);
    for (int x = 0; x < 5; ++x)
        image.set_pixel(x, 0, {1, 1, 1});
    write_image(folder.path("a.png"), image, PixelType::half_float);
    EXPECT_EQ(content_of(folder.path("a.png")).substr(0, 8), "\x89PNG\r\n\x1a\n");
    const Png png = read_png(folder.path("a.png"));
    ASSERT_EQ(png.width, 5);
    ASSERT_EQ(png.height, 3);
    EXPECT_GT(png.rgb[0], 0);
    EXPECT_EQ(png.rgb[3 * 5 * 2], 0);
}

TEST(Png, ShowsAnEvenPictureAtTheExposureKey) {
    // Log-average 40 becomes the key 0.18; with nothing brighter than white no compression follows.
    // sRGB of 0.18 is 117.6 / 255... exactly 0.4613.
    const TemporaryFolder folder;
    Image image(4, 4);
    for (float& x : image.rgb)
        x = 40.0f;
    write_image(folder.path("a.png"), image, PixelType::half_float, 0.18f);
    for (const unsigned char byte : read_png(folder.path("a.png")).rgb)
        EXPECT_EQ(byte, 118);
}

TEST(Png, GetsBrighterWithExposureAndKeepsTheOrderOfPixels) {
    const TemporaryFolder folder;
    Image image(256, 1);
    for (int x = 0; x < 256; ++x)
        image.set_pixel(x, 0, Rgb::Constant(std::exp(0.05f * x)));
    write_image(folder.path("dark.png"), image, PixelType::half_float, 0.05f);
    write_image(folder.path("light.png"), image, PixelType::half_float, 0.5f);
    const Png dark = read_png(folder.path("dark.png")), light = read_png(folder.path("light.png"));
    for (std::size_t i = 0; i < 3 * 255; ++i) {
        EXPECT_LE(dark.rgb[i], dark.rgb[i + 3]);
        EXPECT_LE(dark.rgb[i], light.rgb[i]);
    }
    EXPECT_EQ(dark.rgb[3 * 255], 255); // the brightest pixel is white
}

TEST(Png, BearsBlackPicturesAndValuesThatAreNotFinite) {
    const TemporaryFolder folder;
    Image image(2, 2);
    write_image(folder.path("black.png"), image, PixelType::half_float);
    for (const unsigned char byte : read_png(folder.path("black.png")).rgb)
        EXPECT_EQ(byte, 0);
    image.rgb = {std::numeric_limits<float>::quiet_NaN(),
                 1,
                 1,
                 std::numeric_limits<float>::infinity(),
                 0,
                 0,
                 -5,
                 -5,
                 -5,
                 1,
                 2,
                 3};
    write_image(folder.path("odd.png"), image, PixelType::half_float);
    const std::vector<unsigned char> odd = read_png(folder.path("odd.png")).rgb;
    ASSERT_EQ(odd.size(), 12u);
    EXPECT_EQ(odd[0], 0); // no number
    EXPECT_EQ(std::vector(odd.begin() + 3, odd.begin() + 9), (std::vector<unsigned char>{255, 0, 0, 0, 0, 0}));
    EXPECT_GT(odd[11], 128);
}

TEST(Exr, OfSeveralPartsOnlyTheFirstNeedsColours) {
    const auto header = [](std::initializer_list<const char*> channels, const char* part) {
        Imf::Header h(4, 2);
        for (const char* channel : channels) h.channels().insert(channel, Imf::Channel(Imf::FLOAT));
        h.setName(part);
        h.setType(Imf::SCANLINEIMAGE);
        return h;
    };
    const auto write = [](const std::string& path, std::vector<Imf::Header> headers) {
        std::vector<float> ones(4 * 2, 1.0f);
        Imf::MultiPartOutputFile file(path.c_str(), headers.data(), static_cast<int>(headers.size()));
        for (int p = 0; p < file.parts(); ++p) {
            Imf::FrameBuffer buffer;
            for (auto c = file.header(p).channels().begin(); c != file.header(p).channels().end(); ++c)
                buffer.insert(c.name(), Imf::Slice::Make(Imf::FLOAT, ones.data(), file.header(p).dataWindow()));
            Imf::OutputPart part(file, p);
            part.setFrameBuffer(buffer);
            part.writePixels(2);
        }
    };
    const TemporaryFolder folder;
    write(folder.path("a.exr"), {header({"R", "G", "B"}, "colour"), header({"Z"}, "depth")});
    EXPECT_EQ(read_exr(folder.path("a.exr")).rgb, std::vector<float>(3 * 4 * 2, 1.0f));
    write(folder.path("b.exr"), {header({"Z"}, "depth"), header({"R", "G", "B"}, "colour")});
    EXPECT_THROW(read_exr(folder.path("b.exr")), FileError);
}

TEST(Exr, MayHaveManyChannelsButNotTilesHigherThanTheFileHolds) {
    const auto header_bytes = [](const Imf::Header& header) {
        Imf::StdOSStream stream;
        if (header.hasTileDescription()) Imf::TiledOutputFile(stream, header);
        else Imf::OutputFile(stream, header); // without pixels
        std::string bytes = stream.str();
        bytes.resize(1 << 16);
        return bytes;
    };
    const auto check = [](const std::string& bytes) { check_exr_header("a.exr", std::as_bytes(std::span(bytes))); };
    Imf::Header many(3840, 2160);
    for (const char* name : {"R", "G", "B"}) many.channels().insert(name, Imf::Channel(Imf::HALF));
    for (int k = 0; k < 60; ++k) many.channels().insert("pass" + std::to_string(k), Imf::Channel(Imf::HALF));
    EXPECT_NO_THROW(check(header_bytes(many)));

    Imf::Header tiled(30000, 32);
    for (const char* name : {"R", "G", "B"}) tiled.channels().insert(name, Imf::Channel(Imf::HALF));
    tiled.setTileDescription({64, 64});
    EXPECT_NO_THROW(check(header_bytes(tiled)));
    tiled.setTileDescription({1, 65536}); // a row of which is 2e9 pixels
    EXPECT_THROW(check(header_bytes(tiled)), FileError);
}

TEST(WriteImage, RefusesWhatIsTooLargeBeforehand) {
    EXPECT_NO_THROW(check_picture("a.exr", 16384, 8192));
    EXPECT_THROW(check_picture("a.exr", 16384, 8193), UsageError);
    EXPECT_NO_THROW(check_picture("a.png", 21600, 21600));
    EXPECT_THROW(check_picture("a.png", 21700, 21700), UsageError);
}

TEST(WriteImage, RefusesOtherExtensionsAndMissingFolders) {
    const TemporaryFolder folder;
    EXPECT_THROW(write_image(folder.path("a.jpg"), Image(2, 2), PixelType::half_float), UsageError);
    EXPECT_THROW(write_image(folder.path("a"), Image(2, 2), PixelType::half_float), UsageError);
    EXPECT_THROW(write_image(folder.path("none/a.exr"), Image(2, 2), PixelType::half_float),
                 FileError);
    EXPECT_EQ(folder.count(), 0u);
}

} // namespace
} // namespace afterglow
