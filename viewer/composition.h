#pragma once

#include "core/image.h"
#include "core/tone_map.h"
#include "viewer/geometry_buffer.h"
#include "viewer/gl_objects.h"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace afterglow {

/// What a picture shows of each pixel; the first four are those of `afterglow render`.
enum class ViewLayer {
    full,        // radiance towards the camera, rho (E_direct + E_indirect) / pi
    direct,      // rho E_direct / pi
    indirect,    // rho E_indirect / pi
    irradiance,  // E_indirect
    reflectance, // rho
    normals,     // (n + 1) / 2
};
inline constexpr int view_layers = 6;

const char* view_layer_name(ViewLayer layer);
/// Throws UsageError, which lists the names.
ViewLayer view_layer_from_name(std::string_view name);
/// Reflectance and normals are numbers between 0 and 1, to be shown as they are.
inline bool is_light(ViewLayer layer) { return layer < ViewLayer::reflectance; }
inline bool has_indirect_light(ViewLayer layer) { return is_light(layer) && layer != ViewLayer::direct; }

/// The last passes: from irradiances and a geometry buffer to a picture in linear light, and from that
/// to what a screen shows.
class Composition {
public:
    explicit Composition(const Gl& gl);

    /// Puts a layer together, RGBA32F. The irradiances are textures of the geometry buffer's size.
    void draw(const GeometryBuffer& pixels, GLuint direct, GLuint indirect, ViewLayer layer, int width,
              int height);
    /// The picture on the CPU.
    Image read() const;
    /// Draws the picture, tone mapped where it is light and a map is given, in sRGB into part of a
    /// framebuffer whose first row is the bottom.
    void show(GLuint framebuffer, int x, int y, int width, int height, bool is_light,
              const std::optional<ToneMap>& tone_map, float exposure) const;

private:
    struct Target {
        int width, height;
        GlName picture, framebuffer;
    };
    const Gl& gl_;
    GlProgram layer_program_, show_program_;
    GlName vertex_array_;
    std::optional<Target> target_;
};

} // namespace afterglow
