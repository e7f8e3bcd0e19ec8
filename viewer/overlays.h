#pragma once

#include "core/camera.h"
#include "transport/transfer_scene.h"
#include "viewer/renderer.h"

#include <optional>
#include <vector>

struct ImDrawList;

namespace afterglow {

/// What is drawn over the picture to show the method at work.
enum class Overlay {
    none,
    points,       // of a level [LZT08, fig. 1]
    coefficients, // of the senders' direct light: red positive, blue negative [LZT08, fig. 3]
    links,        // of one function, to its senders
};

/// A place of the picture, in pixels; nothing where a camera does not show it.
std::optional<Vec2> project(const Camera& camera, const Vec3& x);

/// Draws overlays as two-dimensional marks; what lies behind a surface is left out.
class Overlays {
public:
    /// Keeps a reference.
    explicit Overlays(const TransferScene& scene) : scene_(scene) {}

    /// The light changed: coefficients are found anew when they are asked for.
    void set_light(const Spotlight& light);
    /// The function of a level closest to a place.
    void pick(int level, const SurfacePoint& x);

    /// `pixels`: what the camera shows, to see what is hidden.
    void draw(ImDrawList& list, Overlay overlay, int level, const Camera& camera,
              const PixelSurfaces& pixels);

private:
    const TransferScene& scene_;
    Spotlight light_;
    std::vector<float> coefficients_; // four a sender; empty until they are asked for
    std::optional<std::uint32_t> picked_;

    std::optional<Vec2> visible(const Camera& camera, const PixelSurfaces& pixels, std::uint32_t j) const;
    void draw_points(ImDrawList& list, int level, const Camera& camera, const PixelSurfaces& pixels,
                     bool with_coefficients);
    void draw_links(ImDrawList& list, const Camera& camera, const PixelSurfaces& pixels) const;
};

/// The light: a mark, and a line where it shines.
void draw_light(ImDrawList& list, const Spotlight& light, const Camera& camera, float length);

} // namespace afterglow
