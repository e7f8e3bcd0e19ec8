#pragma once

#include "core/scene.h"
#include "viewer/gl_objects.h"
#include "viewer/view_transform.h"

#include <vector>

namespace afterglow {

/// A scene's triangles and textures in OpenGL's memory: 100 bytes a triangle.
class SceneMesh {
public:
    /// Copies what it needs.
    SceneMesh(const Gl& gl, const Scene& scene);

    /// The longest way from a place to any of the scene.
    float farthest(const Vec3& from) const;

    /// Draws what `view` may see, near things first, with the program in use, whose attributes are
    /// position, normal and uv in this order. With `shaded`, it is told of each piece:
    ///     uint first_triangle       gl_PrimitiveID counts from here, see triangle()
    ///     samplerBuffer triangles   unit normals (texture unit 0)
    ///     vec3 reflectance, bool is_textured, sampler2D image (texture unit 1)
    ///     bool has_normal_map, sampler2D normal_map (unit 2), samplerBuffer tangents (unit 3): of each
    ///     triangle, as tangent_of() has it, the sign in w
    void draw(const GlProgram& program, const ViewTransform& view, bool shaded) const;

    /// Triangles are numbered anew, by material; their numbers in the scene.
    std::uint32_t triangle(std::uint32_t number) const { return order_[number]; }
    /// Unit normals by the new numbers, RGBA32F.
    GLuint triangle_normals() const { return triangles_.texture(); }
    bool has_normal_maps() const { return !normal_maps_.empty(); }

private:
    struct Piece { // triangles of one material that lie together
        std::uint32_t first = 0, count = 0;
        Rgb reflectance;
        std::uint32_t texture = no_index, normal_map = no_index;
        Eigen::AlignedBox3f box;
    };
    const Gl& gl_;
    Eigen::AlignedBox3f bounds_;
    std::vector<std::uint32_t> order_;
    std::vector<Piece> pieces_;
    GlName vertices_, vertex_array_;
    GlTextureBuffer triangles_, tangents_;
    std::vector<GlName> textures_, normal_maps_;

    std::vector<GlName> upload(const std::vector<Texture>& textures) const;
};

} // namespace afterglow
