#pragma once

#include "core/camera.h"
#include "transport/display_field.h"
#include "transport/display_patches.h"
#include "viewer/geometry_buffer.h"
#include "viewer/gl_objects.h"

#include <optional>
#include <span>
#include <vector>

namespace afterglow {

/// Indirect irradiance by splatting [LZT08, sec. 4.3]: each function draws a rectangle around its
/// support and adds, at each pixel, its weight and its weighted irradiance; then these are divided.
/// The weights are those of DisplayField::irradiance: factors come from the pixel's patch. Drawn are
/// the functions that some pixel's patch lists, which is what frustum and occlusion leave.
class Splatter {
public:
    explicit Splatter(const Gl& gl);

    /// Copies a field; to be called when the light has moved.
    void set(const DisplayField& field);
    /// Indirect irradiance and 1 where it is covered, RGBA32F, into the whole of `framebuffer`.
    /// `patch`: of each pixel, as from DisplayPatches::find.
    void draw(const GeometryBuffer& pixels, const Camera& camera, const DisplayPatches& patches,
              std::span<const std::uint32_t> patch, GLuint framebuffer);

private:
    struct Targets {
        int width, height;
        GlName patch, sums, framebuffer;
    };
    const Gl& gl_;
    GlProgram add_program_, divide_program_;
    GlName vertex_array_;
    GlTextureBuffer functions_, visible_functions_, row_begin_, row_entries_;
    std::optional<Targets> targets_;
    std::uint32_t first_ = 0; // id of the first function
    int weight_power_ = 2;
    std::size_t rows_there_ = 0, entries_there_ = 0; // of the patches
    std::uint64_t generation_ = 0;
    std::vector<std::uint32_t> visible_;
    std::vector<std::uint8_t> is_listed_;  // a patch each
    std::vector<std::uint8_t> is_visible_; // a function each

    void copy_patches(const DisplayPatches& patches);
    void find_visible(const DisplayPatches& patches, std::span<const std::uint32_t> patch);
};

} // namespace afterglow
