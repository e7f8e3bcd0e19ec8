#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace afterglow {

/// Pixels that a picture may have at most.
constexpr std::int64_t most_exr_pixels = std::int64_t{1} << 27;

/// Reads the header of an OpenEXR file before the library does, which allocates what an attribute, a size
/// or a tile claims, and loses its place where an attribute is not as long as its type. Throws FileError
/// unless all attributes lie inside the file with the sizes of their types, R, G and B are there in full
/// size (in the first part, which alone is read), and the picture is of a size that a file of so many bytes can hold.
void check_exr_header(const std::string& path, std::span<const std::byte> file);

} // namespace afterglow
