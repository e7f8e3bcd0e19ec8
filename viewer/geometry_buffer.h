#pragma once

#include "core/camera.h"
#include "transport/display_patches.h"
#include "viewer/gl_objects.h"
#include "viewer/scene_mesh.h"

#include <optional>
#include <vector>

namespace afterglow {

/// What a camera shows, a surface a pixel: the first pass of deferred shading. Row 0 is the top.
class GeometryBuffer {
public:
    explicit GeometryBuffer(const Gl& gl);

    /// Draws the scene; camera.width and camera.height are the size of the textures. `place`: in each
    /// pixel, (0, 0) its top left.
    void draw(const SceneMesh& mesh, const Camera& camera, const Vec2& place = {0.5f, 0.5f});

    // RGBA32F: position [world]; unit normal as Surface::point has it. RGBA16F: reflectance. R32UI:
    // 2 * triangle (as SceneMesh numbers them) + back side; no_index, and zero in all others, where
    // nothing is.
    GLuint position() const { return targets_->position; }
    GLuint normal() const { return targets_->normal; }
    /// With which light is shown, as Surface::shown_normal has it; the same texture without normal maps.
    GLuint shown_normal() const { return targets_->shown != 0 ? targets_->shown : targets_->normal; }
    GLuint reflectance() const { return targets_->reflectance; }
    GLuint surface() const { return targets_->surface; }

    /// The pixels on the CPU, until the next call.
    const PixelSurfaces& read();
    /// Of the pixels last read.
    std::span<const PixelSurfaces::Float4> shown_normals() const {
        return shown_.empty() ? normals_ : shown_;
    }

private:
    struct Targets {
        int width, height;
        GlName position, normal, reflectance, surface, depth, shown, framebuffer;
        Targets(const Gl& gl, int w, int h, bool with_shown);
    };
    const Gl& gl_;
    GlProgram program_;
    std::optional<Targets> targets_;
    Camera camera_;
    std::vector<PixelSurfaces::Float4> positions_, normals_, shown_; // the last: empty without maps
    std::vector<std::uint32_t> surfaces_;
    PixelSurfaces pixels_;
};

} // namespace afterglow
