#pragma once

#include "core/types.h"

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace afterglow {

/// A linear-light RGB picture; row 0 on top.
struct Image {
    int width = 0, height = 0;
    std::vector<float> rgb; // 3 * width * height
    std::map<std::string, std::string> attributes; // provenance: seed, options, version ...

    Image() = default;
    Image(int w, int h) : width(w), height(h), rgb(3 * static_cast<std::size_t>(w) * h, 0.0f) {}
    Rgb pixel(int x, int y) const { return Rgb::Map(&rgb[3 * (static_cast<std::size_t>(y) * width + x)]); }
    void set_pixel(int x, int y, const Rgb& value) {
        Rgb::Map(&rgb[3 * (static_cast<std::size_t>(y) * width + x)]) = value;
    }
};

enum class PixelType { half_float, full_float };

/// Writes by the extension: .exr (linear, channels R, G, B, string attributes) or .png (tone mapped:
/// Reinhard et al. 2002, global operator at the given exposure key, then sRGB; without a key, values
/// from 0 to 1 are shown as they are). The file appears whole or not at all. Throws FileError;
/// UsageError for another extension, or a picture that is too large (check_picture()).
void write_image(const std::string& path, const Image& image, PixelType type,
                 std::optional<float> exposure = 0.18f);

/// Throws UsageError where write_image() would: for another extension, for more than 2^27 pixels as .exr, which
/// read_exr() would refuse, and for more than 1.4e9 bytes (about 460 million pixels) as .png.
void check_picture(const std::string& path, int width, int height);

/// Writes a PNG file of bytes as they are, R, G, B each, rows from the top. Throws FileError.
void write_png_bytes(const std::string& path, int width, int height, std::span<const unsigned char> rgb);

/// Reads channels R, G, B of an OpenEXR file. Throws FileError.
Image read_exr(const std::string& path);

} // namespace afterglow
