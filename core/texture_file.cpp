#include "core/texture_file.h"

#include "core/error.h"
#include "core/file.h"
#include "core/normal_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <new>
#include <string_view>

// Built here rather than taken from the shared library: the readers of other formats follow null pointers
// or read behind their buffers where a file is damaged, and those that are read use tables which the file never
// filled, of colours and codes. Of zeros, the same file gives the same picture; on the stack the compiler makes
// them (CMakeLists.txt). Want of memory it takes for a damaged file.
namespace {
thread_local bool lacked_memory = false;

void* noted(void* memory) {
    if (!memory) lacked_memory = true;
    return memory;
}
} // namespace
#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_ONLY_BMP
#define STBI_ONLY_JPEG
#define STBI_ONLY_PNG
#define STBI_ONLY_TGA
#define STBI_NO_STDIO
#define STBI_MALLOC(size) noted(std::calloc(size, 1))
#define STBI_REALLOC(memory, size) noted(std::realloc(memory, size))
#define STBI_FREE std::free
// Where a JPEG picture ends before its last number, zero is shifted by more bits than there are: which is zero.
#ifdef __clang__
#pragma clang attribute push(__attribute__((no_sanitize("shift-exponent"))), apply_to = function)
#endif
#include <stb_image.h>
#ifdef __clang__
#pragma clang attribute pop
#endif

namespace afterglow {
namespace {

using namespace std::string_view_literals;

constexpr std::uint64_t most_texels = std::uint64_t{1} << 26;
constexpr std::size_t most_bytes = 999'999'999; // stb_image counts them as int
constexpr std::string_view png = "\x89PNG";
constexpr std::size_t png_signature = 8;
constexpr std::string_view bmp = "BM";
constexpr std::string_view jpeg = "\xff\xd8", filled_jpeg = "\xff\xff"; // stb_image would read both

float linear_from_srgb(int byte) {
    const float s = static_cast<float>(byte) / 255.0f;
    return s <= 0.04045f ? s / 12.92f : std::pow((s + 0.055f) / 1.055f, 2.4f);
}

/// As many texels as a picture file of this size can hold, however even its colour. stb_image fills up
/// what is missing, so that a header alone would come out as a picture as large as it says.
std::uint64_t most_texels_in(std::string_view file) {
    constexpr std::size_t depth_at = 24; // bits a channel
    if (file.size() <= depth_at || !file.starts_with(png))
        return 1024 * file.size(); // JPEG packs best: no less than a bit for 64 texels of a channel
    const auto depth = std::uint64_t{static_cast<unsigned char>(file[depth_at])};
    return 8 * 1032 * file.size() / std::max<std::uint64_t>(depth, 1); // deflate packs 1032 bytes into one
}

/// The number that a picture starts with, in `bytes` bytes; 0 where there are fewer.
std::uint64_t big_endian(std::string_view picture, std::size_t bytes) {
    std::uint64_t number = 0;
    for (const char c : picture.substr(0, picture.size() < bytes ? 0 : bytes))
        number = number << 8 | static_cast<unsigned char>(c);
    return number;
}

/// False where a chunk of a PNG file is longer than what is left: stb_image allocates what it claims.
bool has_whole_chunks(std::string_view file) {
    constexpr std::size_t head = 8, tail = 4; // length and type; check sum
    file.remove_prefix(std::min(file.size(), png_signature));
    while (!file.starts_with("\0\0\0\0IEND"sv)) {
        if (file.size() < head) return false;
        const std::uint64_t length = big_endian(file, 4);
        if (length + head + tail > file.size()) return false;
        file.remove_prefix(length + head + tail);
    }
    return true;
}

/// False where a table of a JPEG segment "Huffman tables" has more codes than a byte has values: stb_image
/// writes them behind its array. `segment` starts with its length and may be longer.
bool has_sound_tables(std::string_view segment) {
    constexpr std::size_t lengths = 16, most_codes = 256;
    const std::uint64_t end = std::min<std::uint64_t>(big_endian(segment, 2), segment.size());
    for (std::size_t at = 2; at < end;) {
        std::size_t codes = 0;
        for (const char count : segment.substr(at + 1, lengths)) // beyond `end` as well
            codes += static_cast<unsigned char>(count);
        if (codes > most_codes) return false;
        at += 1 + lengths + codes;
    }
    return true;
}

/// Segments that say how long they are.
bool has_length(char marker) {
    return (marker & '\xf0') == '\xe0' || "\xfe\xc4\xdb\xdd\xda"sv.find(marker) != std::string_view::npos;
}

/// Calls visit(marker, what follows it, whether it is before the first scan) for each marker of a JPEG file, until
/// it returns false. Up to the first scan, segments are passed over as a whole; behind it, all that looks like a
/// marker is taken for one, also within segments unless these are to be `whole`.
template <class Visit>
void for_each_marker(std::string_view file, bool whole, const Visit& visit) {
    constexpr char scan = '\xda';
    bool in_header = true;
    for (std::size_t at = 2; at + 2 <= file.size();) {
        const char marker = file[at + 1];
        if (file[at] != '\xff' || marker == '\xff' || marker == '\0') {
            ++at;
            continue;
        }
        const std::string_view segment = file.substr(at + 2);
        in_header = in_header && marker != scan;
        if (!visit(marker, segment, in_header)) return;
        at += in_header || (whole && has_length(marker)) ? 2 + big_endian(segment, 2) : 1;
    }
}

/// Likewise of a JPEG file.
bool has_sound_jpeg_tables(std::string_view file) {
    constexpr char huffman_tables = '\xc4';
    bool is_sound = true;
    for_each_marker(file, false, [&](char marker, std::string_view segment, bool) {
        is_sound = marker != huffman_tables || has_sound_tables(segment);
        return is_sound;
    });
    return is_sound;
}

/// A JPEG file without what cameras put behind its picture.
std::string_view picture_alone(std::string_view file) {
    constexpr char end = '\xd9';
    std::size_t size = file.size();
    for_each_marker(file, true, [&](char marker, std::string_view segment, bool in_header) {
        if (in_header || marker != end) return true;
        size -= segment.size();
        return false;
    });
    return file.substr(0, size);
}

/// False where a BMP file of few colours has no table of them.
bool has_colour_table(std::string_view file) {
    constexpr std::size_t offset_at = 10, header_at = 14, old_depth_at = 24, depth_at = 28;
    constexpr std::uint64_t old_header = 12;
    const auto number = [&](std::size_t at, std::size_t bytes) {
        std::uint64_t n = 0;
        for (std::size_t k = bytes; k-- > 0;)
            n = n << 8 | (at + k < file.size() ? static_cast<unsigned char>(file[at + k]) : 0u);
        return n;
    };
    const std::uint64_t header = number(header_at, 4);
    const bool old = header == old_header;
    const std::uint64_t depth = number(old ? old_depth_at : depth_at, 2);
    return depth >= 16 || number(offset_at, 4) > header_at + (old ? 2 : 1) * header; // as stb_image counts
}

/// A picture whose bytes stand for the numbers of a table. Throws FileError where the file holds none
/// that stb_image reads.
Texture read_picture(const std::string& path, const std::array<float, 256>& value) {
    const MappedFile file(path);
    const auto bytes = file.bytes();
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (text.starts_with(jpeg)) text = picture_alone(text);
    if ((text.starts_with(png) && !has_whole_chunks(text))
        || (text.starts_with(jpeg) && !has_sound_jpeg_tables(text)) || text.starts_with(filled_jpeg)
        || (text.starts_with(bmp) && !has_colour_table(text)))
        throw FileError(path, "is damaged or cut short");
    const auto* data = reinterpret_cast<const stbi_uc*>(bytes.data());
    const int size = text.size() <= most_bytes ? static_cast<int>(text.size()) : 0;
    Texture texture;
    int channels = 0;
    lacked_memory = false;
    const bool is_known = stbi_info_from_memory(data, size, &texture.width, &texture.height, &channels) != 0;
    if (lacked_memory) throw std::bad_alloc();
    if (text.starts_with(bmp) && texture.height < 0 && texture.height > std::numeric_limits<int>::min())
        texture.height = -texture.height; // rows from the top
    if (!is_known || texture.width < 1 || texture.height < 1)
        throw FileError(path, "is no picture in PNG, JPEG, TGA or BMP");
    const std::uint64_t count =
        static_cast<std::uint64_t>(texture.width) * static_cast<std::uint64_t>(texture.height);
    if (count > std::min(most_texels, most_texels_in(text)))
        throw FileError(path, "has an impossible size of " + std::to_string(texture.width) + "x"
                                  + std::to_string(texture.height) + " texels in "
                                  + std::to_string(text.size()) + " bytes");
    const std::unique_ptr<stbi_uc, void (*)(void*)> texels(
        stbi_load_from_memory(data, size, &texture.width, &texture.height, &channels, 3),
        stbi_image_free);
    if (lacked_memory) throw std::bad_alloc();
    if (!texels) throw FileError(path, "is damaged");

    const std::size_t row = 3 * static_cast<std::size_t>(texture.width);
    texture.rgb.resize(row * static_cast<std::size_t>(texture.height));
    for (int y = 0; y < texture.height; ++y) { // the file's first row is on top
        const stbi_uc* from = texels.get() + row * static_cast<std::size_t>(texture.height - 1 - y);
        std::transform(from, from + row, &texture.rgb[row * static_cast<std::size_t>(y)],
                       [&](stbi_uc byte) { return value[byte]; });
    }
    return texture;
}

} // namespace

Texture read_texture(const std::string& path) {
    std::array<float, 256> linear{};
    for (int i = 0; i < 256; ++i)
        linear[static_cast<std::size_t>(i)] = linear_from_srgb(i);
    return read_picture(path, linear);
}

Texture read_normal_map(const NormalSource& source) {
    std::array<float, 256> share{};
    for (int i = 0; i < 256; ++i)
        share[static_cast<std::size_t>(i)] = static_cast<float>(i) / 255.0f;
    Texture picture = read_picture(source.file, share);
    return source.may_be_heights && !is_normal_map(picture)
               ? normals_from_heights(picture, source.multiplier)
               : normals_from_colours(std::move(picture));
}

} // namespace afterglow
