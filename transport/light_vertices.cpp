#include "transport/light_vertices.h"

#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

namespace afterglow {

ConeSampler::ConeSampler(const Spotlight& light) : axis_(light.direction), falloff_(light) {
    cos_outer_ = cos_degrees(light.outer_angle);
    const bool hard = light.inner_angle == light.outer_angle;
    ramp_width_ =
        hard ? 0.0 : std::max(0.001, cos_degrees(light.inner_angle) - cos_outer_);
    ramp_end_ = std::min(1.0, cos_outer_ + ramp_width_);
    ramp_integral_ =
        hard ? 0.0 : std::pow(ramp_end_ - cos_outer_, 3.0) / (3.0 * ramp_width_ * ramp_width_);
    flat_integral_ = 1.0 - ramp_end_;
    inverse_total_ = static_cast<float>(0.5 / std::numbers::pi / (ramp_integral_ + flat_integral_));
}

Vec3 ConeSampler::direction(const Vec2& u) const {
    const double below = u.x() * (ramp_integral_ + flat_integral_);
    const double c = below < ramp_integral_
                         ? cos_outer_ + std::cbrt(3.0 * ramp_width_ * ramp_width_ * below)
                         : ramp_end_ + (below - ramp_integral_);
    const double s = std::sqrt(std::max(0.0, (1.0 - c) * (1.0 + c)));
    const double phi = 2.0 * std::numbers::pi * u.y();
    const Eigen::Vector3d local(s * std::cos(phi), s * std::sin(phi), c);
    return Frame(axis_).to_world(local.cast<float>());
}

float light_vertex_pdf(const ConeSampler& sampler, const Spotlight& light, const Vec3& position,
                       const Vec3& geometric_normal) {
    const Vec3 to_light = light.position - position;
    const float squared = to_light.squaredNorm();
    if (!(squared > 0.0f)) return 0.0f;
    const Vec3 direction = to_light / std::sqrt(squared);
    return std::max(0.0f, direction.dot(geometric_normal)) / squared
           * sampler.pdf(-direction.dot(light.direction));
}

void trace_light_vertices(const Surface& surface, const Spotlight& light,
                          const ConeSampler& sampler, std::uint64_t seed,
                          std::span<const std::uint32_t> indices, std::span<LightVertex> vertices) {
    constexpr std::size_t block = 64;
    assert(vertices.size() == indices.size());
    const Falloff falloff(light);
    std::array<Ray, block> rays;
    std::array<Hit, block> hits;
    for (std::size_t begin = 0; begin < vertices.size(); begin += block) {
        const std::size_t count = std::min(block, vertices.size() - begin);
        for (std::size_t k = 0; k < count; ++k)
            rays[k] = {light.position,
                       sampler.direction(shuffled_sobol2(indices[begin + k], seed))};
        surface.closest_hits({rays.data(), count}, {hits.data(), count});
        for (std::size_t k = 0; k < count; ++k) {
            LightVertex& vertex = vertices[begin + k];
            vertex.radiosity = Rgb::Zero();
            if (!hits[k]) continue;
            vertex.x = surface.point(hits[k]);
            vertex.geometric_normal = surface.geometric_normal(hits[k]);
            vertex.pdf =
                light_vertex_pdf(sampler, light, vertex.x.position, vertex.geometric_normal);
            vertex.radiosity =
                surface.reflectance(hits[k]) * unoccluded_irradiance(light, falloff, vertex.x);
        }
    }
}

float cosine_share(const SurfacePoint& v, const Vec3& y, const Vec3& geometric_normal,
                   float light_pdf) {
    if (light_pdf == 0.0f) return 1.0f;
    const Vec3 to_y = y - v.position;
    const float squared = to_y.squaredNorm();
    const float length = std::sqrt(squared);
    // Both densities times the cosine at y, which may vanish.
    const float by_cosine = std::max(0.0f, v.normal.dot(to_y)) / length
                            * static_cast<float>(1.0 / EIGEN_PI)
                            * std::abs(geometric_normal.dot(to_y)) / length;
    const float by_light = light_pdf * squared;
    return by_cosine + by_light > 0.0f ? by_cosine / (by_cosine + by_light) : 1.0f;
}

} // namespace afterglow
