#pragma once

#include "core/types.h"

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace afterglow {

inline constexpr std::uint32_t no_index = std::numeric_limits<std::uint32_t>::max();
using Triangle = std::array<std::uint32_t, 3>; // three indices, counter-clockwise from the front

/// A picture of three numbers a texel: in linear light, what multiplies a material's reflectance, or
/// directions, see normal_map.h. Row 0 at the bottom (v = 0), repeats in u and v, bilinear.
struct Texture {
    int width = 0, height = 0;
    std::vector<float> rgb; // 3 * width * height
    Rgb sample(const Vec2& uv) const;
};

/// A Lambertian surface, the same on both sides.
struct Material {
    std::string name;
    Rgb reflectance = Rgb::Constant(0.5f); // [0, 1), times the texture where there is one
    std::uint32_t texture = no_index;
    std::uint32_t normal_map = no_index; // of Scene::normal_maps
};

/// What the loader met and mended, for the one summary line.
struct SceneSummary {
    std::uint64_t faces = 0, triangles = 0;
    std::uint64_t dropped_degenerate = 0;    // zero area
    std::uint64_t dropped_not_finite = 0;    // NaN or infinite coordinates
    std::uint64_t dropped_bad_index = 0;     // an index outside its list
    std::uint64_t replaced_normals = 0;      // corners whose normal was unusable
    std::uint64_t default_material = 0;      // triangles without a known material
    std::uint64_t clamped_reflectance = 0;   // materials outside [0, 1)
    std::vector<std::string> missing_files;  // MTL files and textures that could not be read
    std::vector<std::string> outside_files;  // read, though not in the scene's folder or below it
    std::string line() const;                // one line, only what is not zero
    std::string outside_line() const;        // of outside_files alone; empty where there are none
};

/// Static triangles with Lambertian reflectance. Indices are valid and coordinates finite.
struct Scene {
    std::string name;                          // path as given, or "builtin:..."
    std::vector<Vec3> positions;               // vertices
    std::vector<Triangle> triangles;           // indices of `positions`
    std::vector<Vec3> normals;                 // unit length; may be empty
    std::vector<Triangle> normal_indices;      // a triangle each, no_index where it has none; may be empty
    std::vector<Vec2> texture_coordinates;     // may be empty
    std::vector<Triangle> texture_indices;     // like normal_indices; may be empty
    std::vector<std::uint32_t> material_index; // a triangle each
    std::vector<Material> materials;
    std::vector<Texture> textures;
    std::vector<Texture> normal_maps; // unit vectors, see normal_map.h
    std::optional<Vec3> viewpoint; // a place in the open from which the scene is looked at, where known
    SceneSummary summary;

    Eigen::AlignedBox3f bounds() const;
    /// Of unit length, to the front of a triangle; zero where it has no area.
    Vec3 triangle_normal(std::uint32_t triangle) const;
    /// 128-bit hash of everything that light transport sees, as 32 hexadecimal digits. Normal maps are
    /// not part of it: only pictures see them, and a transfer file fits the scene with others as well.
    std::string content_hash() const;
};

/// Loads a Wavefront OBJ file or makes the built-in scene "builtin:NAME".
/// Throws FileError or UsageError (unknown built-in name; the message lists the known ones).
Scene load_scene(const std::string& path_or_name);

} // namespace afterglow
