#pragma once

#include <string>
#include <string_view>

namespace afterglow {

inline constexpr char mtl_blank_in_name = '\x1f';

/// The text of an MTL file in words that tinyobjloader understands as the format means them:
///  - without a byte order mark;
///  - names of materials have mtl_blank_in_name for their blanks, where some versions end them;
///  - "Kd 0.8" is "Kd 0.8 0.8 0.8", and a material with a map_Kd and no Kd is white;
///  - the options -o, -s and -t of textures have all three numbers, or the file's name would be taken for one.
std::string mtl_for_tinyobj(std::string_view text);

} // namespace afterglow
