#pragma once

#include "core/scene.h"
#include "core/types.h"

namespace afterglow {

// Normal maps: textures whose texels are unit vectors in a frame that follows the texture
// coordinates, x along rising u, y along rising v, z along the surface's normal. Only pictures see
// them, light transport takes the surface as it is.

/// Whether a picture's channels, 0 to 1 as its file has them, are those of a normal map: nine texels
/// of ten are no grey, of length 1 to within 0.15, and point out of the surface.
bool is_normal_map(const Texture& picture);

/// Reads the channels, 0 to 1, as coordinates: 128/255 is 0, 1/255 is -1, 1 is 1. Texels that are no
/// direction (shorter than 0.1) become (0, 0, 1).
Texture normals_from_colours(Texture picture);

/// Of a height field, the mean of the channels times `multiplier`, in widths of a texel; central
/// differences, repeated at the borders like the texture.
Texture normals_from_heights(const Texture& picture, float multiplier);

/// In which direction u rises across a triangle.
struct Tangent {
    Vec3 direction = Vec3::Zero(); // unit length, in the plane; zero where there is none
    float sign = 1.0f;             // -1 where texture coordinates are mirrored: seen from the front,
                                   // v rises to the right of u's direction
};
/// None where the triangle has no texture coordinates, or they span no area.
Tangent tangent_of(const Scene& scene, std::uint32_t triangle);

/// A direction of a normal map, of any length, in the world, unit length. `normal`: the interpolated
/// one, `geometric`: the triangle's own, both on the viewer's side, which is the back of the winding
/// where `back_side`. Seen from there, the map's hills are dents. What would point into the surface,
/// or along it, is bent up to 0.01 above it. `normal` where the tangent says nothing.
Vec3 mapped_normal(const Vec3& mapped, const Tangent& tangent, const Vec3& normal,
                   const Vec3& geometric, bool back_side);

} // namespace afterglow
