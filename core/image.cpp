#include "core/image.h"

#include "core/error.h"
#include "core/exr_header.h"
#include "core/file.h"
#include "core/tone_map.h"

#include <Iex.h>
#include <ImathBox.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <half.h>
#include <new>
#include <span>

// Built here rather than taken from the shared library, which ends the process where memory is short.
namespace {
void* checked(void* memory) {
    if (!memory) throw std::bad_alloc();
    return memory;
}
} // namespace
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#define STBIW_MALLOC(size) checked(std::malloc(size))
#define STBIW_REALLOC(memory, size) checked(std::realloc(memory, size))
#define STBIW_FREE std::free
#include <stb_image_write.h>

namespace afterglow {
namespace {

constexpr const char* channel_names[3] = {"R", "G", "B"};

std::size_t pixel_count(const Image& image) {
    return static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
}

/// Slices over interleaved RGB values whose first pixel belongs at the corner of `window`.
template <class T>
Imf::FrameBuffer frame_buffer(T* rgb, Imf::PixelType type, const Imath::Box2i& window) {
    const std::size_t pixel = 3 * sizeof(T);
    const auto width = static_cast<std::size_t>(window.max.x - window.min.x + 1);
    Imf::FrameBuffer buffer;
    for (int c = 0; c < 3; ++c)
        buffer.insert(channel_names[c],
                      Imf::Slice::Make(type, rgb + c, window, pixel, width * pixel));
    return buffer;
}

std::vector<half> to_half(const std::vector<float>& values) {
    std::vector<half> halves(values.size());
    std::transform(values.begin(), values.end(), halves.begin(), [](float x) {
        return half(std::isfinite(x) ? std::clamp(x, -float{HALF_MAX}, float{HALF_MAX}) : x);
    });
    return halves;
}

std::string encode_exr(const Image& image, PixelType type) {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const auto& [name, text] : image.attributes)
        header.insert(name, Imf::StringAttribute(text));
    const auto exr_type = type == PixelType::half_float ? Imf::HALF : Imf::FLOAT;
    for (const char* name : channel_names)
        header.channels().insert(name, Imf::Channel(exr_type));

    std::vector<float> floats;
    std::vector<half> halves;
    Imf::FrameBuffer buffer;
    if (type == PixelType::half_float) {
        halves = to_half(image.rgb);
        buffer = frame_buffer(halves.data(), exr_type, header.dataWindow());
    } else {
        floats = image.rgb; // the library asks for writable memory
        buffer = frame_buffer(floats.data(), exr_type, header.dataWindow());
    }
    // Into memory first: the library's own file writer cannot report a disk that fills up at the
    // end.
    Imf::StdOSStream stream;
    {
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(buffer);
        file.writePixels(image.height);
    }
    return stream.str();
}

/// A file in memory, as the library asks for it.
class MemoryStream : public Imf::IStream {
public:
    MemoryStream(const std::string& name, std::span<const std::byte> bytes)
        : IStream(name.c_str()), bytes_(bytes) {}

    bool read(char to[], int count) override {
        const auto wanted = static_cast<std::size_t>(count);
        if (count < 0 || at_ > bytes_.size() || wanted > bytes_.size() - at_)
            throw Iex::InputExc("it ends too early");
        std::memcpy(to, bytes_.data() + at_, wanted);
        at_ += wanted;
        return at_ < bytes_.size();
    }
    std::uint64_t tellg() override { return at_; }
    void seekg(std::uint64_t position) override { at_ = position; }

private:
    std::span<const std::byte> bytes_;
    std::uint64_t at_ = 0;
};

unsigned char srgb_byte(float linear) {
    if (!(linear > 0.0f)) return 0; // NaN as well
    const float x = std::min(linear, 1.0f);
    const float s = x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1.0f / 2.4f) - 0.055f;
    return static_cast<unsigned char>(std::lround(255.0f * s));
}

std::string compress_png(int width, int height, std::span<const unsigned char> rgb) {
    std::string png;
    const auto append = [](void* target, void* data, int size) {
        static_cast<std::string*>(target)->append(static_cast<const char*>(data),
                                                  static_cast<std::size_t>(size));
    };
    if (stbi_write_png_to_func(append, &png, width, height, 3, rgb.data(), 3 * width) == 0)
        throw std::bad_alloc();
    return png;
}

std::string encode_png(const Image& image, std::optional<float> key) {
    const std::optional<ToneMap> tone_map = key ? std::optional(ToneMap(image, *key)) : std::nullopt;
    std::vector<unsigned char> bytes(3 * pixel_count(image));
    for (std::size_t i = 0; i < pixel_count(image); ++i) {
        const Rgb linear = Rgb::Map(&image.rgb[3 * i]);
        const Rgb mapped = tone_map ? (*tone_map)(linear) : linear;
        for (int c = 0; c < 3; ++c)
            bytes[3 * i + c] = srgb_byte(mapped[c]);
    }
    return compress_png(image.width, image.height, bytes);
}

} // namespace

void check_picture(const std::string& path, int width, int height) {
    const bool is_exr = path.ends_with(".exr");
    if (!is_exr && !path.ends_with(".png")) throw UsageError(path + ": a picture's name must end in .exr or .png");
    // Of EXR, what read_exr() takes. Of PNG, stb_image_write counts bytes in an int, doubles what it writes into, up to
    // 3 * 2^29, and needs at most nine bits a byte, of which there are three a pixel and one a line.
    constexpr std::int64_t most_png_bytes = 1'400'000'000;
    const auto w = static_cast<std::int64_t>(width);
    if (is_exr ? w * height > most_exr_pixels : (3 * w + 1) * height > most_png_bytes)
        throw UsageError(path + ": a picture of " + std::to_string(width) + "x" + std::to_string(height)
                         + " is too large; at most " + (is_exr ? "134 million pixels as .exr" : "460 million as .png"));
}

void write_image(const std::string& path, const Image& image, PixelType type,
                 std::optional<float> exposure) {
    assert(image.width > 0 && image.height > 0 && image.rgb.size() == 3 * pixel_count(image));
    std::string encoded;
    try {
        check_picture(path, image.width, image.height);
        encoded = path.ends_with(".exr") ? encode_exr(image, type) : encode_png(image, exposure);
    } catch (const Error&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& e) {
        throw FileError(path, std::string("cannot be encoded: ") + e.what());
    }
    write_file(path, encoded);
}

void write_png_bytes(const std::string& path, int width, int height, std::span<const unsigned char> rgb) {
    assert(rgb.size() == 3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    write_file(path, compress_png(width, height, rgb));
}

Image read_exr(const std::string& path) {
    try {
        const MappedFile mapped(path);
        check_exr_header(path, mapped.bytes());
        MemoryStream stream(path, mapped.bytes());
        Imf::InputFile file(stream);
        const Imf::Header& header = file.header();
        const Imath::Box2i window = header.dataWindow();
        Image image(window.max.x - window.min.x + 1, window.max.y - window.min.y + 1);
        file.setFrameBuffer(frame_buffer(image.rgb.data(), Imf::FLOAT, window));
        file.readPixels(window.min.y, window.max.y);
        for (auto a = header.begin(); a != header.end(); ++a)
            if (const auto* text = dynamic_cast<const Imf::StringAttribute*>(&a.attribute()))
                image.attributes[a.name()] = text->value();
        return image;
    } catch (const Error&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& e) {
        throw FileError(path, "cannot be read as OpenEXR: " + printable(e.what()));
    }
}

} // namespace afterglow
