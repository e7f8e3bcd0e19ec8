#include "core/exr_header.h"

#include "core/error.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace afterglow {
namespace {

constexpr std::string_view magic = "\x76\x2f\x31\x01";
constexpr std::int32_t several_parts = 0x1000; // flag of the version
constexpr std::size_t longest_word = 255;      // of a name or a type
constexpr std::uint8_t dwab = 9;               // the compression that takes most lines at a time

// What a header may ask for at most. Black compresses best: a byte of the file stands for some hundred
// pixels of ours, for two thousand of a lossy method's.
constexpr std::int64_t longest_side = 1 << 16;
constexpr std::int64_t most_pixels_per_byte = 4096;

struct FixedType {
    std::string_view name;
    std::size_t bytes;
};
constexpr std::array<FixedType, 26> fixed_types = {{
    {"box2f", 16}, {"box2i", 16}, {"chromaticities", 32}, {"compression", 1}, {"deepImageState", 1},
    {"double", 8}, {"envmap", 1}, {"float", 4},           {"int", 4},         {"keycode", 28},
    {"lineOrder", 1}, {"m33d", 72}, {"m33f", 36},         {"m44d", 128},      {"m44f", 64},
    {"rational", 8}, {"tiledesc", 9}, {"timecode", 8},    {"v2d", 16},        {"v2f", 8},
    {"v2i", 8},    {"v3d", 24},   {"v3f", 12},            {"v3i", 12},        {"v4d", 32},
    {"v4f", 16},
}};

/// Bytes that are taken from the front.
class Bytes {
public:
    Bytes(const std::string& path, std::string_view rest) : path_(path), rest_(rest) {}

    [[noreturn]] void fail() const {
        throw FileError(path_, "has a damaged OpenEXR header, or is cut short; write it again");
    }
    bool empty() const { return rest_.empty(); }
    char next() const { return rest_.empty() ? '\0' : rest_.front(); }
    std::string_view take(std::uint64_t count) {
        if (count > rest_.size()) fail();
        const std::string_view taken = rest_.substr(0, count);
        rest_.remove_prefix(count);
        return taken;
    }
    template <class Number>
    Number number() {
        Number value{};
        std::memcpy(&value, take(sizeof(value)).data(), sizeof(value));
        return value;
    }
    std::string_view word() {
        const std::size_t length = rest_.find('\0');
        if (length > longest_word) fail(); // npos as well
        const std::string_view taken = take(length);
        take(1);
        return taken;
    }

private:
    const std::string& path_;
    std::string_view rest_;
};

/// One part of a file.
struct Part {
    std::int64_t width = 0, height = 0; // 0: not said
    std::uint8_t compression = 0;
    std::int64_t channels = 0;
    bool red = false, green = false, blue = false; // in full size
    std::int64_t tile_width = 0, tile_height = 0;  // 0: lines

    void read_window(Bytes value) {
        const auto left = value.number<std::int32_t>(), top = value.number<std::int32_t>();
        const auto right = value.number<std::int32_t>(), bottom = value.number<std::int32_t>();
        width = std::int64_t{right} - left + 1;
        height = std::int64_t{bottom} - top + 1;
    }
    void read_channels(Bytes value) {
        for (std::string_view name = value.word(); !name.empty(); name = value.word()) {
            value.take(8); // type, whether it is linear
            const auto x = value.number<std::int32_t>(), y = value.number<std::int32_t>();
            ++channels;
            if (x != 1 || y != 1) continue;
            red = red || name == "R";
            green = green || name == "G";
            blue = blue || name == "B";
        }
        if (!value.empty()) value.fail();
    }
    void read_tiles(Bytes value) {
        tile_width = value.number<std::uint32_t>();
        tile_height = value.number<std::uint32_t>();
    }
};

void check_preview(Bytes value) {
    const std::uint64_t width = value.number<std::uint32_t>(), height = value.number<std::uint32_t>();
    if (width >= 1 << 16 || height >= 1 << 16) value.fail();
    value.take(4 * width * height);
    if (!value.empty()) value.fail();
}

void check_strings(Bytes value) {
    while (!value.empty())
        value.take(value.number<std::uint32_t>());
}

/// Takes one attribute; false at the end of the header.
bool read_attribute(const std::string& path, Bytes& header, Part& part) {
    const std::string_view name = header.word();
    if (name.empty()) return false;
    const std::string_view type = header.word();
    const std::string_view bytes = header.take(header.number<std::uint32_t>());
    const Bytes value(path, bytes);
    const auto fixed = std::find_if(fixed_types.begin(), fixed_types.end(),
                                    [&](const FixedType& t) { return t.name == type; });
    if (fixed != fixed_types.end() && fixed->bytes != bytes.size()) value.fail();
    if (type == "preview") check_preview(value);
    if (type == "stringvector") check_strings(value);
    if (type == "floatvector" && bytes.size() % sizeof(float) != 0) value.fail(); // the rest would be left unread
    if (type == "chlist") part.read_channels(value);
    if (name == "dataWindow" && type == "box2i") part.read_window(value);
    if (name == "compression" && type == "compression") part.compression = std::uint8_t(bytes[0]);
    if (name == "tiles" && type == "tiledesc") part.read_tiles(value);
    return true;
}

void check_size(const std::string& path, const Part& part, std::size_t file_bytes) {
    const auto is_side = [](std::int64_t length) { return length >= 0 && length <= longest_side; };
    const bool has_sides = part.width > 0 && part.height > 0 && is_side(part.width) && is_side(part.height)
                           && is_side(part.tile_width) && is_side(part.tile_height);
    const std::int64_t most = std::min(most_exr_pixels, most_pixels_per_byte * static_cast<std::int64_t>(file_bytes));
    // The picture itself is of three channels, and so is a row of tiles. Buffers hold all channels: they are as wide as
    // the picture and as high as what is compressed at a time, or as large as a tile.
    const std::int64_t lines = part.compression == dwab ? 256 : 32;
    const std::int64_t most_for_all = 3 * most / std::max<std::int64_t>(part.channels, 3);
    if (!has_sides || part.width * std::max(part.height, part.tile_height) > most || part.width * lines > most_for_all
        || part.tile_width * part.tile_height > most_for_all)
        throw FileError(path, "has an impossible size of " + std::to_string(part.width) + "x"
                                  + std::to_string(part.height) + " pixels, or of its tiles, for "
                                  + std::to_string(file_bytes) + " bytes; write it again");
}

} // namespace

void check_exr_header(const std::string& path, std::span<const std::byte> file) {
    Bytes rest(path, {reinterpret_cast<const char*>(file.data()), file.size()});
    if (file.size() < 8 || rest.take(4) != magic) throw FileError(path, "is no OpenEXR file");
    const bool more = (rest.number<std::int32_t>() & several_parts) != 0;
    for (bool is_first = true; is_first || (more && rest.next() != '\0'); is_first = false) {
        Part part;
        while (read_attribute(path, rest, part)) {
        }
        check_size(path, part, file.size());
        if (is_first && !(part.red && part.green && part.blue))
            throw FileError(path, "has not R, G and B as full-size channels, which are needed");
    }
}

} // namespace afterglow
