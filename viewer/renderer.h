#pragma once

#include "transport/transfer_scene.h"
#include "viewer/composition.h"
#include "viewer/geometry_buffer.h"
#include "viewer/shadow_map.h"
#include "viewer/splatter.h"

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

namespace afterglow {

/// How pixels come by indirect light: splatted by OpenGL, gathered by the CPU, or by what was faster
/// when it was first asked for. Both make the same picture.
enum class IndirectMethod { splat, gather, automatic };

const char* indirect_method_name(IndirectMethod method);
/// "splat", "gather" or "auto"; throws UsageError for another name.
IndirectMethod indirect_method_from_name(std::string_view name);

/// Wall-clock seconds of a picture's stages; zero for those that still held.
struct FrameTimings {
    double geometry = 0.0, shadow_map = 0.0, direct = 0.0;
    double patches = 0.0; // reading the geometry buffer, DisplayPatches::find
    double indirect = 0.0, composition = 0.0;
    double total() const {
        return geometry + shadow_map + direct + patches + indirect + composition;
    }
    FrameTimings& operator+=(const FrameTimings& more);
};

/// Pictures of a transfer scene by deferred shading, on whatever OpenGL there is. Of each stage only
/// what the camera's or the light's motion asks for is done again.
class Renderer {
public:
    /// Keeps references; the context must be current whenever a method is called.
    Renderer(const Gl& gl, const TransferScene& scene, IndirectMethod method);

    /// The light, and the indirect light that it makes: they change together.
    void set_light(const Spotlight& light, std::shared_ptr<const DisplayField> field);
    void set_method(IndirectMethod method);
    IndirectMethod method() const { return method_; } // automatic until it was measured

    /// Draws a layer as it is at one place of each pixel, (0, 0) the top left. Patches at most
    /// `most_new`, see DisplayPatches::find.
    void draw(const Camera& camera, ViewLayer layer, std::size_t most_new = DisplayPatches::no_limit,
              const Vec2& place = {0.5f, 0.5f});
    /// The mean over `samples` places, those of render_picture(), in linear light.
    Image average(const Camera& camera, ViewLayer layer, int samples);
    /// How many patches of the last picture are still to come: it gets better when it is drawn again.
    std::size_t patches_missing() const { return patches_missing_; }
    /// Pixels of the last picture with a surface that no function covers.
    std::size_t uncovered_pixels() const;
    const FrameTimings& timings() const { return timings_; }

    /// The last picture in linear light.
    Image read() const { return composition_.read(); }
    const Composition& composition() const { return composition_; }
    const GeometryBuffer& geometry() const { return geometry_; }
    const SceneMesh& mesh() const { return mesh_; }
    /// What the pixels of the last picture show.
    const PixelSurfaces& pixels();

private:
    struct Targets {
        int width, height;
        GlName direct, direct_framebuffer, indirect, indirect_framebuffer;
    };
    const Gl& gl_;
    SceneMesh mesh_;
    GeometryBuffer geometry_;
    ShadowMap shadow_map_;
    Splatter splatter_;
    Composition composition_;
    ShepardBasis basis_;
    DisplayPatches patches_;
    IndirectMethod method_;

    std::optional<Targets> targets_;
    std::optional<Camera> camera_; // of what is in the geometry buffer
    Vec2 place_ = Vec2::Zero();
    Spotlight light_;
    std::shared_ptr<const DisplayField> field_;
    bool shadow_map_is_old_ = true, direct_is_old_ = true, indirect_is_old_ = true;
    bool splatter_is_old_ = true, patches_are_old_ = true;
    const PixelSurfaces* pixels_ = nullptr;
    std::vector<std::uint32_t> patch_;
    std::size_t patches_missing_ = 0;
    std::vector<PixelSurfaces::Float4> gathered_;
    FrameTimings timings_;

    void draw_geometry(const Camera& camera, const Vec2& place);
    void draw_direct();
    void find_patches(std::size_t most_new);
    void draw_indirect();
    void splat();
    void gather();
    /// Seconds of a stage until OpenGL has finished.
    template <class Stage>
    double measured(const Stage& stage) const;
};

} // namespace afterglow
