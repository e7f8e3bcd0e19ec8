#include "transport/direct_light.h"

#include "basis/nearest_points.h"
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
constexpr float golden_section = 0.38196601f; // of a turn, between places one after the other

float radians(float degrees) {
    return degrees * static_cast<float>(EIGEN_PI / 180.0);
}

/// s(d) / d.
float relative_scale(const Spotlight& light) {
    return light.outer_angle < 45.0f ? std::tan(radians(light.outer_angle)) : 1.0f;
}

/// p of s / R.
float share_of_scale(float scale) {
    const float t = std::clamp((scale - only_splatted) / (only_sampled - only_splatted), 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

} // namespace

float sampled_share(const Spotlight& light, float distance, float spacing) {
    return share_of_scale(relative_scale(light) * distance / spacing);
}

DirectLight::DirectLight(const PointHierarchy& points, int level, std::span<const float> areas,
                         const Surface& surface)
    : points_(points), level_(level), areas_(areas), surface_(surface),
      basis_(points, surface, true, level) {
    find_neighbours();
}

void DirectLight::find_neighbours() {
    const Index begin = points_.begin(level_), count = points_.end(level_) - begin;
    const NearestPoints nearest(points_.position.middleCols(begin, count));
    neighbours_.resize(static_cast<std::size_t>(count));
    parallel_for(count, [&](Index k) {
        Neighbours& found = neighbours_[static_cast<std::size_t>(k)];
        found.fill(static_cast<std::uint32_t>(k));
        std::vector<std::uint32_t> near;
        nearest.closest(points_.position.col(begin + k), 2 * static_cast<int>(found.size()), near);
        std::size_t n = 0;
        for (const std::uint32_t other : near)
            if (other != k && n < found.size()
                && points_.normal.col(begin + other).dot(points_.normal.col(begin + k)) > 0.5f)
                found[n++] = other;
    });
}

void DirectLight::radiosity(const Spotlight& light, std::span<float> result) const {
    sample(light, result);
    splat(light, result);
}

void DirectLight::sample_points(const Spotlight& light, std::span<Lit> lit,
                                std::span<float> result) const {
    const Index begin = points_.begin(level_);
    const float scale = relative_scale(light) / points_.spacing[level_];
    const Falloff falloff(light);
    constexpr Index grain = 256;
    parallel_ranges(static_cast<Index>(lit.size()), grain, [&](Index first, Index last) {
        std::array<Vec3, grain> from, to;
        std::array<Index, grain> asked;
        std::array<std::uint8_t, grain> blocked;
        std::size_t rays = 0;
        for (Index k = first; k < last; ++k) {
            Lit& here = lit[static_cast<std::size_t>(k)];
            Rgb::Map(&result[3 * static_cast<std::size_t>(k)]).setZero();
            const SurfacePoint x = points_.point(begin + k);
            const Vec3 to_light = light.position - x.position;
            if (to_light.dot(x.normal) <= 0.0f) continue;
            const float distance = to_light.norm();
            here.sampled = share_of_scale(scale * distance);
            if (here.sampled == 0.0f) continue;
            here.seen = falloff(-to_light.dot(light.direction) / distance);
            if (here.seen == 0.0f) continue;
            from[rays] = surface_.lifted(x);
            to[rays] = light.position;
            asked[rays++] = k;
        }
        surface_.blocked(std::span(from).first(rays), std::span(to).first(rays), blocked);
        for (std::size_t r = 0; r < rays; ++r) {
            const auto k = static_cast<std::size_t>(asked[r]);
            if (blocked[r])
                lit[k].seen = 0.0f;
            else
                Rgb::Map(&result[3 * k]) =
                    unoccluded_irradiance(light, falloff, points_.point(begin + asked[r]));
        }
    });
}

bool DirectLight::on_edge(std::span<const Lit> lit, std::size_t k) const {
    constexpr float difference = 0.25f;
    return lit[k].seen != unasked && std::ranges::any_of(neighbours_[k], [&](std::uint32_t other) {
        return lit[other].seen != unasked && std::abs(lit[other].seen - lit[k].seen) > difference;
    });
}

Rgb DirectLight::mean_irradiance(const Spotlight& light, const Falloff& falloff, Index k) const {
    constexpr std::size_t count = 8;
    constexpr float share_of_spacing = 0.25f, lift_share = 0.0f;
    const Index j = points_.begin(level_) + k;
    const SurfacePoint x = points_.point(j);
    const float size = std::min(points_.spacing[level_], points_.support[j]);
    const Frame frame(x.normal);
    const float turn = unit_float(static_cast<std::uint32_t>(hash64(static_cast<std::uint64_t>(k))));

    // In the plane of x, a little above it; those behind something do not count.
    std::array<Vec3, count> centre, place, target;
    std::array<std::uint8_t, count> apart, shadowed;
    centre.fill(surface_.lifted(x));
    target.fill(light.position);
    for (std::size_t s = 0; s < count; ++s) {
        const float radius = share_of_spacing * size * std::sqrt((s + 0.5f) / count);
        const float phi = 2.0f * static_cast<float>(EIGEN_PI) * (turn + golden_section * s);
        place[s] = centre[s]
                   + frame.to_world({radius * std::cos(phi), radius * std::sin(phi), lift_share * size});
    }
    surface_.blocked(centre, place, apart);
    surface_.blocked(place, target, shadowed);
    Rgb sum = Rgb::Zero();
    int counted = 0;
    for (std::size_t s = 0; s < count; ++s) {
        if (apart[s]) continue;
        ++counted;
        if (!shadowed[s]) sum += unoccluded_irradiance(light, falloff, {place[s], x.normal});
    }
    return counted > 0 ? Rgb(sum / static_cast<float>(counted))
                       : direct_irradiance(surface_, light, x);
}

void DirectLight::sample(const Spotlight& light, std::span<float> result) const {
    const Index begin = points_.begin(level_);
    std::vector<Lit> lit(neighbours_.size());
    sample_points(light, lit, result);
    const Falloff falloff(light);
    parallel_for(
        static_cast<Index>(lit.size()),
        [&](Index k) {
            const auto at = static_cast<std::size_t>(k);
            if (lit[at].seen == unasked) return;
            auto b = Rgb::Map(&result[3 * at]);
            if (on_edge(lit, at)) b = mean_irradiance(light, falloff, k);
            b *= lit[at].sampled * points_.reflectance.col(begin + k).array();
        },
        256);
}

void DirectLight::splat(const Spotlight& light, std::span<float> result) const {
    const float scale = relative_scale(light) / points_.spacing[level_];
    const float farthest = only_sampled / scale;
    const float height = 1.0f - std::cos(radians(light.outer_angle)); // of the cone's spherical cap
    const float solid_angle = 2.0f * static_cast<float>(EIGEN_PI) * height;
    const Frame frame(light.direction);
    const Falloff falloff_of(light);

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
            const Vec3 local = sample_cone(u, height);
            rays[k - first] = {light.position, frame.to_world(local), farthest};
            falloff[k - first] = falloff_of(local.z());
        }
        const auto count = static_cast<std::size_t>(last - first);
        surface_.closest_hits(std::span(rays).first(count), std::span(hits).first(count));
        for (Index k = first; k < last; ++k) {
            const Hit& hit = hits[k - first];
            const float splatted =
                hit ? falloff[k - first] * (1.0f - share_of_scale(scale * hit.distance)) : 0.0f;
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
