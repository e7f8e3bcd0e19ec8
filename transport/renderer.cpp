#include "transport/renderer.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>

namespace afterglow {
namespace {

constexpr Index pixels_at_once = 64;

/// What one sample of a pixel adds, and whether the display had something to say there.
struct Shader {
    const Surface& surface;
    const Display& display;
    const VectorIrradiance& field;
    const Spotlight& light;
    Layer layer;
    int gap_paths;

    Rgb operator()(const Hit& hit, bool& covered) const {
        const SurfacePoint x = surface.point(hit);
        const Vec3 shown = surface.shown_normal(hit, x);
        Rgb irradiance = Rgb::Zero();
        if (layer == Layer::direct || layer == Layer::full)
            irradiance += direct_irradiance(surface, light, x, shown);
        if (layer != Layer::direct) irradiance += display.irradiance(x, shown, field, light, covered, gap_paths);
        if (layer == Layer::irradiance) return irradiance;
        return surface.reflectance(hit) / static_cast<float>(EIGEN_PI) * irradiance;
    }
};

} // namespace

std::vector<Vec2> pixel_pattern(int samples) {
    if (samples == 1) return {Vec2(0.5f, 0.5f)};
    std::vector<Vec2> pattern;
    for (int k = 0; k < samples; ++k)
        pattern.push_back(scrambled_sobol2(static_cast<std::uint32_t>(k), 1));
    return pattern;
}

RenderedPicture render_picture(const Surface& surface, const Display& display,
                               const VectorIrradiance& field, const Spotlight& light,
                               const Camera& camera, Layer layer, int samples,
                               int gap_paths) {
    const int paths_of_sample = gap_paths > 0 ? std::max(16, gap_paths / samples) : 0;
    const Shader shade{surface, display, field, light, layer, paths_of_sample};
    const std::vector<Vec2> pattern = pixel_pattern(samples);
    const Index pixel_count = static_cast<Index>(camera.width) * camera.height;
    RenderedPicture result;
    result.image = Image(camera.width, camera.height);
    std::vector<std::uint8_t> is_uncovered(static_cast<std::size_t>(pixel_count), 0);
    parallel_ranges(pixel_count, pixels_at_once, [&](Index begin, Index end) {
        std::vector<Ray> rays(pattern.size());
        std::vector<Hit> hits(pattern.size());
        for (Index pixel = begin; pixel < end; ++pixel) {
            const auto x = static_cast<int>(pixel % camera.width);
            const auto y = static_cast<int>(pixel / camera.width);
            for (std::size_t k = 0; k < rays.size(); ++k)
                rays[k] = {camera.position,
                           camera.direction(static_cast<float>(x) + pattern[k].x(),
                                            static_cast<float>(y) + pattern[k].y())};
            surface.closest_hits(rays, hits);
            Rgb sum = Rgb::Zero();
            for (const Hit& hit : hits) {
                if (!hit) continue;
                bool covered = true;
                sum += shade(hit, covered);
                if (!covered) is_uncovered[static_cast<std::size_t>(pixel)] = 1;
            }
            result.image.set_pixel(x, y, sum / static_cast<float>(samples));
        }
    });
    for (const std::uint8_t uncovered : is_uncovered)
        result.uncovered_pixels += uncovered;
    return result;
}

} // namespace afterglow
