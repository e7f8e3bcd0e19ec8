#pragma once

#include "core/scene.h"

#include <string>

namespace afterglow {

/// Loads a Wavefront OBJ file with its MTL files, map_Kd textures and normal maps; lines, points and
/// free-form surfaces are ignored. Reflectance is Kd times map_Kd, each white where the other stands alone, with
/// texture coordinates times -s plus -o. A normal map is what `norm` names, or else `map_Bump` or `bump`; the
/// latter two are heights, times -bm, unless they look like normals (see normal_map.h). Pictures are
/// PNG, JPEG, TGA or BMP; of each 8 bits a channel are read.
/// Faults that leave a usable scene are mended and told in `summary`:
///  - polygons are cut into triangles, concave ones too; triangles of zero area, with a vertex
///  index
///    outside the list, or with a coordinate that is no number or beyond 1e12 are dropped;
///  - a triangle with an unusable normal loses its three normals, likewise texture coordinates;
///  - a material that is missing is a grey of 0.5, a reflectance is clamped to [0, 0.999], a
///  texture
///    that is missing counts as white, a normal map that is missing as flat.
/// Vertices that no kept triangle uses are left out. MTL files are sought beside the OBJ, textures
/// beside their MTL; what is read from outside the OBJ's folder, by its path or through a symbolic
/// link, is named in `summary`.
/// Nothing is allocated by a size that a file claims but cannot hold.
/// Throws FileError where the file cannot be read or nothing usable remains.
Scene load_obj(const std::string& path);

} // namespace afterglow
