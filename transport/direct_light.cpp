#include "transport/direct_light.h"

#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/sender_rows.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace afterglow {
namespace {

constexpr float only_splatted = 4.0f, only_sampled = 10.0f; // s / R
constexpr std::uint32_t splatted_rays = 1 << 13;

float radians(float degrees) {
    return degrees * static_cast<float>(EIGEN_PI / 180.0);
}

/// s(d) / d.
float relative_scale(const Spotlight& light) {
    return light.outer_angle < 45.0f ? std::tan(radians(light.outer_angle)) : 1.0f;
}

} // namespace

float sampled_share(const Spotlight& light, float distance, float spacing) {
    const float scale = relative_scale(light) * distance / spacing;
    const float t = std::clamp((scale - only_splatted) / (only_sampled - only_splatted), 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

DirectLight::DirectLight(const PointHierarchy& points, int level, std::span<const float> areas,
                         const Surface& surface)
    : points_(points), level_(level), areas_(areas), surface_(surface),
      basis_(points, surface, true, level) {}

void DirectLight::radiosity(const Spotlight& light, std::span<float> result) const {
    sample(light, result);
    splat(light, result);
}

void DirectLight::sample(const Spotlight& light, std::span<float> result) const {
    const Index begin = points_.begin(level_);
    parallel_for(
        points_.end(level_) - begin,
        [&](Index k) {
            const SurfacePoint x = points_.point(begin + k);
            const float share = sampled_share(light, (x.position - light.position).norm(),
                                              points_.spacing[level_]);
            Rgb b = Rgb::Zero();
            if (share > 0.0f)
                b = share * points_.reflectance.col(begin + k).array()
                    * direct_irradiance(surface_, light, x);
            Rgb::Map(&result[3 * static_cast<std::size_t>(k)]) = b;
        },
        256);
}

void DirectLight::splat(const Spotlight& light, std::span<float> result) const {
    const float spacing = points_.spacing[level_];
    const float farthest = only_sampled * spacing / relative_scale(light);
    const float height = 1.0f - std::cos(radians(light.outer_angle)); // of the cone's spherical cap
    const float solid_angle = 2.0f * static_cast<float>(EIGEN_PI) * height;
    const Frame frame(light.direction);

    struct Splat {
        std::vector<BasisEntry> row;
        Rgb power; // reflected [W]
    };
    std::vector<Splat> splats(splatted_rays);
    constexpr Index packet = 64;
    parallel_ranges(splatted_rays, packet, [&](Index first, Index last) {
        std::array<Ray, packet> rays;
        std::array<float, packet> falloff;
        std::array<Hit, packet> hits;
        for (Index k = first; k < last; ++k) {
            const Vec2 u = scrambled_sobol2(static_cast<std::uint32_t>(k), 17);
            const float c = 1.0f - u.x() * height;
            const float s = std::sqrt(std::max(0.0f, 1.0f - c * c));
            const float phi = 2.0f * static_cast<float>(EIGEN_PI) * u.y();
            rays[k - first] = {light.position,
                               frame.to_world({s * std::cos(phi), s * std::sin(phi), c}), farthest};
            falloff[k - first] = light.falloff(c);
        }
        const auto count = static_cast<std::size_t>(last - first);
        surface_.closest_hits(std::span(rays).first(count), std::span(hits).first(count));
        for (Index k = first; k < last; ++k) {
            const Hit& hit = hits[k - first];
            const float splatted =
                hit ? falloff[k - first] * (1.0f - sampled_share(light, hit.distance, spacing)) : 0.0f;
            if (splatted == 0.0f) continue;
            Splat& splat = splats[k];
            sender_row(surface_, basis_, level_, hit, splat.row);
            splat.power = (splatted * solid_angle / splatted_rays) * light.intensity
                          * surface_.reflectance(hit);
        }
    });
    const std::uint32_t begin = points_.begin(level_);
    for (const Splat& splat : splats)
        for (const BasisEntry& entry : splat.row) {
            const std::size_t j = entry.index - begin;
            if (areas_[j] > 0.0f)
                Rgb::Map(&result[3 * j]) += (entry.value / areas_[j]) * splat.power;
        }
}

} // namespace afterglow
