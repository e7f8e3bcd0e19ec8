#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "core/surface.h"
#include "transport/display.h"
#include "transport/path_tracer.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <vector>

namespace afterglow {

struct RenderedPicture {
    Image image; // no attributes; black where the camera sees nothing
    /// Pixels with a sample on a surface that no function covers: there is no indirect light there.
    std::uint64_t uncovered_pixels = 0;
};

/// The picture of render_reference() by precomputed transport. `field`, as from
/// LightTransport::indirect() under the same light, is not looked at for Layer::direct, and may be
/// empty then. `samples` a pixel, in the same stratified pattern in each: box filter. Together they
/// have about `gap_paths` paths in a gap (Display::irradiance); 0: functions alone, as in the viewer.
RenderedPicture render_picture(const Surface& surface, const Display& display,
                               const VectorIrradiance& field, const Spotlight& light,
                               const Camera& camera, Layer layer, int samples,
                               int gap_paths = 256);

/// Where in each pixel [0, 1)^2 the samples of render_picture lie, the same in each: a pattern that
/// changed from pixel to pixel would fray edges. Each of `samples` columns and rows of equal width
/// holds one where their number is a power of two; one alone lies in the middle.
std::vector<Vec2> pixel_pattern(int samples);

} // namespace afterglow
