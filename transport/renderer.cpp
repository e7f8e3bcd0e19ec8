#include "transport/renderer.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <vector>

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

    Rgb operator()(const Hit& hit, bool& covered) const {
        const SurfacePoint x = surface.point(hit);
        Rgb irradiance = Rgb::Zero();
        if (layer == Layer::direct || layer == Layer::full)
            irradiance += direct_irradiance(surface, light, x);
        if (layer != Layer::direct) irradiance += display.irradiance(x, field, covered);
        if (layer == Layer::irradiance) return irradiance;
        return surface.reflectance(hit) / static_cast<float>(EIGEN_PI) * irradiance;
    }
};

} // namespace

RenderedPicture render_picture(const Surface& surface, const Display& display,
                               const VectorIrradiance& field, const Spotlight& light,
                               const Camera& camera, Layer layer, const RenderOptions& options) {
    const Shader shade{surface, display, field, light, layer};
    const Index pixel_count = static_cast<Index>(camera.width) * camera.height;
    const auto samples = static_cast<std::size_t>(options.samples);
    RenderedPicture result;
    result.image = Image(camera.width, camera.height);
    std::vector<std::uint8_t> is_uncovered(static_cast<std::size_t>(pixel_count), 0);
    parallel_ranges(pixel_count, pixels_at_once, [&](Index begin, Index end) {
        std::vector<Ray> rays(samples);
        std::vector<Hit> hits(samples);
        for (Index pixel = begin; pixel < end; ++pixel) {
            const auto left = static_cast<int>(pixel % camera.width);
            const auto top = static_cast<int>(pixel / camera.width);
            const std::uint64_t pixel_seed =
                hash64(options.seed, static_cast<std::uint64_t>(pixel));
            for (std::size_t k = 0; k < samples; ++k) {
                const Vec2 u = scrambled_sobol2(static_cast<std::uint32_t>(k), pixel_seed);
                rays[k] = {camera.position, camera.direction(static_cast<float>(left) + u.x(),
                                                             static_cast<float>(top) + u.y())};
            }
            surface.closest_hits(rays, hits);
            Rgb sum = Rgb::Zero();
            for (const Hit& hit : hits) {
                if (!hit) continue;
                bool covered = true;
                sum += shade(hit, covered);
                if (!covered) is_uncovered[static_cast<std::size_t>(pixel)] = 1;
            }
            result.image.set_pixel(left, top, sum / static_cast<float>(samples));
        }
    });
    for (const std::uint8_t uncovered : is_uncovered)
        result.uncovered_pixels += uncovered;
    return result;
}

} // namespace afterglow
