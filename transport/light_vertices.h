#pragma once

#include "core/surface.h"
#include "core/types.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <span>

namespace afterglow {

/// Directions within a spotlight's cone with a density proportional to its falloff.
class ConeSampler {
public:
    explicit ConeSampler(const Spotlight& light);
    Vec3 direction(const Vec2& u) const;
    /// Density [1/sr] of a direction whose cosine to the axis is c.
    float pdf(float c) const { return falloff_(c) * inverse_total_; }

private:
    Vec3 axis_;
    Falloff falloff_;
    double cos_outer_, ramp_width_,
        ramp_end_;                         // falloff is ((c - cos_outer) / width)^2 below the end
    double ramp_integral_, flat_integral_; // over c
    float inverse_total_;                  // 1 / (2 pi (ramp + flat))
};

/// Where a ray of a spotlight ends: the second vertex of a path traced from the light.
struct LightVertex {
    SurfacePoint x;              // turned to the light
    Vec3 geometric_normal;       // turned likewise
    Rgb radiosity = Rgb::Zero(); // reflectance times direct irradiance; zero where the ray is lost
    float pdf = 0.0f;            // of this vertex by area [1/m^2]
};

/// Density by area with which rays of the light arrive at a place it sees; zero where the geometric
/// normal, turned to whoever asks, faces away from the light.
float light_vertex_pdf(const ConeSampler& sampler, const Spotlight& light, const Vec3& position,
                       const Vec3& geometric_normal);

/// Traces vertices.size() rays, the k-th by the indices[k]-th point of the sequence `seed`.
void trace_light_vertices(const Surface& surface, const Spotlight& light,
                          const ConeSampler& sampler, std::uint64_t seed,
                          std::span<const std::uint32_t> indices, std::span<LightVertex> vertices);

/// Both ways of finding y from v share the light that comes directly over y by the balance
/// heuristic [Veach and Guibas 1995]: a cosine-distributed ray from v that meets y, with the
/// density cos / pi, and a ray of the light, with light_pdf by area, that is
///
///     light_pdf |v - y|^2 / cos(y's geometric normal, v - y)   per solid angle at v.
///
/// Returns the share of the former; reflectance x irradiance x share is what either adds to v's
/// irradiance (the latter times the visibility of y). geometric_normal is turned to v.
float cosine_share(const SurfacePoint& v, const Vec3& y, const Vec3& geometric_normal,
                   float light_pdf);

} // namespace afterglow
