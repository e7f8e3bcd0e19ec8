#pragma once

#include "core/scene.h"

#include <compare>
#include <string>

namespace afterglow {

/// A picture of normals, or of heights if it does not look like normals.
struct NormalSource {
    std::string file; // path, empty where there is none
    bool may_be_heights = false;
    float multiplier = 1.0f; // of heights
    auto operator<=>(const NormalSource&) const = default;
};

/// Reads a picture (PNG, JPEG, TGA or BMP), 8 bits a channel, from sRGB into linear light. Throws
/// FileError where that is the file's fault, else as MappedFile does; nothing is allocated by a size that the file claims but cannot hold.
Texture read_texture(const std::string& path);

/// Likewise, into unit vectors, see normal_map.h.
Texture read_normal_map(const NormalSource& source);

} // namespace afterglow
