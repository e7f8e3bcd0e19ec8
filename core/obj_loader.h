#pragma once

#include "core/scene.h"

#include <string>

namespace afterglow {

/// Loads a Wavefront OBJ file with its MTL files and map_Kd textures; lines, points and free-form
/// surfaces are ignored. Faults that leave a usable scene are mended and told in `summary`:
///  - polygons are cut into triangles, concave ones too; triangles of zero area, with a vertex
///  index
///    outside the list, or with a coordinate that is no number or beyond 1e18 are dropped;
///  - a triangle with an unusable normal loses its three normals, likewise texture coordinates;
///  - a material that is missing is a grey of 0.5, a reflectance is clamped to [0, 0.999], a
///  texture
///    that is missing counts as white.
/// Vertices that no kept triangle uses are left out. MTL files are sought beside the OBJ, textures
/// beside their MTL.
/// Throws FileError where the file cannot be read or nothing usable remains.
Scene load_obj(const std::string& path);

} // namespace afterglow
