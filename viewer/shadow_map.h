#pragma once

#include "transport/spotlight.h"
#include "viewer/geometry_buffer.h"
#include "viewer/gl_objects.h"
#include "viewer/scene_mesh.h"

#include <array>
#include <vector>

namespace afterglow {

/// Direct light of a spotlight with shadows [Williams 1978]: pictures of what the light sees, which
/// hold the distance from it; one where the cone is narrow, else those faces of a cube that it meets.
class ShadowMap {
public:
    explicit ShadowMap(const Gl& gl);

    /// Draws what the light sees; to be called when it has moved.
    void draw(const SceneMesh& mesh, const Spotlight& light);

    /// Irradiance [W/m^2] by a light at the pixels of a geometry buffer, RGBA32F, into the whole of
    /// `framebuffer`. The light may differ from that of the last draw() in intensity and inner angle.
    ///
    /// A pixel compares four texels around it, each with the distance at which the light's ray
    /// through the texel's centre meets the plane of the pixel's triangle, and blends what they say: no
    /// bias that grows with the slope is needed, and shadows begin where things touch.
    void shade(const SceneMesh& mesh, const Spotlight& light, const GeometryBuffer& pixels, GLuint framebuffer,
               int width, int height);

private:
    struct Face {
        Vec3 forward, right, down;
    };
    const Gl& gl_;
    GlProgram distance_program_, shade_program_;
    GlName vertex_array_; // of passes without attributes
    GlName distances_, depth_, framebuffer_;
    int layers_ = 0; // of the textures
    std::vector<Face> faces_;
    float half_width_ = 1.0f; // of the pictures, at distance one

    void prepare(int layers);
};

} // namespace afterglow
