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
constexpr float rays_a_sender = 64.0f; // that count, where all is splatted; of all rays at least:
constexpr float least_share = 1.0f / 8.0f;

float radians(float degrees) {
    return degrees * static_cast<float>(EIGEN_PI / 180.0);
}

struct SplattedPlace {
    Vec2 u;      // in the unit square
    float order; // in the sequence, from 0 to 1: the first ones are well spread by themselves
};

/// Where the splatted rays leave; along a Z-order curve, so that rays of one packet are alike.
std::vector<SplattedPlace> splatted_places() {
    struct Place {
        std::uint32_t code;
        SplattedPlace place;
    };
    std::vector<Place> places(splatted_rays);
    for (std::uint32_t k = 0; k < splatted_rays; ++k) {
        const Vec2 u = scrambled_sobol2(k, 17);
        std::uint32_t code = 0;
        for (int bit = 0; bit < 12; ++bit)
            for (int axis = 0; axis < 2; ++axis)
                code |= (static_cast<std::uint32_t>(u[axis] * 4096.0f) >> bit & 1u) << (2 * bit + axis);
        places[k] = {code, {u, static_cast<float>(k) / splatted_rays}};
    }
    std::stable_sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.code < b.code; });
    std::vector<SplattedPlace> sorted;
    for (const Place& place : places) sorted.push_back(place.place);
    return sorted;
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

/// Of the rays, the share that counts where s / R times 1 - p is this: as many a sender, the fewer the less of
/// the light is splatted.
float counted_share(float splatted_scale) {
    return std::clamp(rays_a_sender / splatted_rays * static_cast<float>(EIGEN_PI) * splatted_scale * splatted_scale,
                      least_share, 1.0f);
}

/// The cosine with which light falls on the shading normal ÷ that on the triangle: irradiance is taken by
/// the first, a ray's flux by the second.
float shading_share(const Hit& hit, const SurfacePoint& y, const Vec3& direction) {
    constexpr float least_cosine = 1e-3f; // below, hardly any light falls on the triangle
    return std::max(0.0f, -direction.dot(y.normal)) / std::max(least_cosine, hit.cosine);
}

} // namespace

float sampled_share(const Spotlight& light, float distance, float spacing) {
    return share_of_scale(relative_scale(light) * distance / spacing);
}

DirectLight::DirectLight(const PointHierarchy& points, int level, std::span<const float> areas,
                         const Surface& surface)
    : points_(points), level_(level), areas_(areas), surface_(surface),
      neighbours_(points.end(level) - points.begin(level)), neighbours_known_(neighbours_.size()),
      apart_(neighbours_.size()) {
    for (std::atomic<std::uint16_t>& apart : apart_) apart.store(apart_unknown, std::memory_order_relaxed);
}

const NearestPoints& DirectLight::nearest() const {
    std::call_once(nearest_made_, [&] {
        const Index begin = points_.begin(level_), count = points_.end(level_) - begin;
        nearest_ = std::make_unique<NearestPoints>(points_.position.middleCols(begin, count));
    });
    return *nearest_;
}

const ShepardBasis& DirectLight::basis() const {
    std::call_once(basis_made_, [&] { // by a thread of a parallel loop
        isolated([&] { basis_ = std::make_unique<ShepardBasis>(points_, surface_, true, level_); });
    });
    return *basis_;
}

void DirectLight::find_neighbours(std::size_t k, Neighbours& found) const {
    const Index begin = points_.begin(level_), here = begin + static_cast<Index>(k);
    found.fill(static_cast<std::uint32_t>(k));
    std::vector<std::uint32_t> near;
    nearest().closest(points_.position.col(here), 2 * static_cast<int>(found.size()), near);
    std::size_t n = 0;
    for (const std::uint32_t other : near)
        if (other != k && n < found.size()
            && points_.normal.col(begin + other).dot(points_.normal.col(here)) > 0.5f)
            found[n++] = other;
}

/// Found when they are first asked for. Who asks while another is at it finds them for himself.
const DirectLight::Neighbours& DirectLight::neighbours(std::size_t k, Neighbours& scratch) const {
    std::atomic<std::uint8_t>& state = neighbours_known_[k];
    std::uint8_t was = state.load(std::memory_order_acquire);
    if (was == known) return neighbours_[k];
    if (was == unknown && state.compare_exchange_strong(was, at_work)) {
        find_neighbours(k, neighbours_[k]);
        state.store(known, std::memory_order_release);
        return neighbours_[k];
    }
    find_neighbours(k, scratch);
    return scratch;
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
    Neighbours scratch;
    return lit[k].seen != unasked && std::ranges::any_of(neighbours(k, scratch), [&](std::uint32_t other) {
        return lit[other].seen != unasked && std::abs(lit[other].seen - lit[k].seen) > difference;
    });
}

Rgb DirectLight::mean_irradiance(const Spotlight& light, const Falloff& falloff, Index k) const {
    constexpr std::size_t count = 8;
    constexpr float share_of_spacing = 0.25f;
    const Index j = points_.begin(level_) + k;
    const SurfacePoint x = points_.point(j);
    const float size = std::min(points_.spacing[level_], points_.support[j]);
    const Frame frame(x.normal);
    const float turn = unit_float(static_cast<std::uint32_t>(hash64(static_cast<std::uint64_t>(k))));

    // In the plane of x, a little above it; those behind something do not count.
    std::array<Vec3, count> centre, place, target;
    std::array<std::uint8_t, count> shadowed;
    centre.fill(surface_.lifted(x));
    target.fill(light.position);
    for (std::size_t s = 0; s < count; ++s) {
        const Vec2 at = share_of_spacing * size * spiral_point(static_cast<float>(s) + 0.5f, count, turn);
        place[s] = centre[s] + frame.to_world({at.x(), at.y(), 0.0f});
    }
    std::uint16_t apart = apart_[static_cast<std::size_t>(k)].load(std::memory_order_relaxed);
    if (apart == apart_unknown) {
        std::array<std::uint8_t, count> blocked;
        surface_.blocked(centre, place, blocked);
        apart = 0;
        for (std::size_t s = 0; s < count; ++s) apart |= static_cast<std::uint16_t>(blocked[s] << s);
        apart_[static_cast<std::size_t>(k)].store(apart, std::memory_order_relaxed);
    }
    surface_.blocked(place, target, shadowed);
    Rgb sum = Rgb::Zero();
    int counted = 0;
    for (std::size_t s = 0; s < count; ++s) {
        if (apart >> s & 1) continue;
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

void DirectLight::keep_seen(const SurfacePoint& y, std::vector<BasisEntry>& row) const {
    const std::uint32_t begin = points_.begin(level_);
    float on_edge = 0.0f;
    for (const BasisEntry& entry : row)
        if (areas_[entry.index - begin] == SenderRows::in_few_rows) on_edge += entry.value;
    std::erase_if(row, [&](const BasisEntry& entry) { return !(areas_[entry.index - begin] > 0.0f); });
    if (on_edge == 0.0f) return;
    // By area, so that all are equally bright: one alone may be seen but in a corner of it, and would glare.
    constexpr int looked_at = 24;
    constexpr std::size_t most = 4;
    thread_local std::vector<std::uint32_t> near;
    nearest().closest(y.position, looked_at, near);
    const std::size_t own = row.size();
    float area = 0.0f;
    for (const std::uint32_t k : near) {
        if (row.size() == own + most) break;
        const SurfacePoint other = points_.point(begin + k);
        if (!(areas_[k] > 0.0f) || other.normal.dot(y.normal) <= 0.5f
            || surface_.blocked(surface_.lifted(y), surface_.lifted(other)))
            continue;
        area += areas_[k];
        row.push_back({begin + k, on_edge * areas_[k]});
    }
    for (BasisEntry& added : std::span(row).subspan(own)) added.value /= area;
}

void DirectLight::splat(const Spotlight& light, std::span<float> result) const {
    const float scale = relative_scale(light) / points_.spacing[level_];
    const float farthest = only_sampled / scale;
    const float height = 1.0f - cos_degrees(light.outer_angle); // of the cone's spherical cap
    const float solid_angle = 2.0f * static_cast<float>(EIGEN_PI) * height;
    const Frame frame(light.direction);
    const Falloff falloff_of(light);
    static const std::vector<SplattedPlace> places = splatted_places();

    struct Splat {
        std::vector<BasisEntry> row;
        Rgb power; // reflected [W]
    };
    constexpr Index packet = 64;
    std::vector<std::vector<Splat>> splats(splatted_rays / packet); // in the order of the rays
    parallel_ranges(splatted_rays, packet, [&](Index first, Index last) {
        std::array<Ray, packet> rays;
        std::array<float, packet> falloff;
        std::array<Hit, packet> hits;
        for (Index k = first; k < last; ++k) {
            const Vec3 local = sample_cone(places[static_cast<std::size_t>(k)].u, height);
            rays[k - first] = {light.position, frame.to_world(local), farthest};
            falloff[k - first] = falloff_of(local.z());
        }
        const auto count = static_cast<std::size_t>(last - first);
        surface_.closest_hits(std::span(rays).first(count), std::span(hits).first(count));
        for (Index k = first; k < last; ++k) {
            const Hit& hit = hits[k - first];
            if (!hit) continue;
            const float share = 1.0f - share_of_scale(scale * hit.distance);
            const float counted = counted_share(scale * hit.distance * share);
            if (places[static_cast<std::size_t>(k)].order >= counted) continue;
            const float splatted = falloff[k - first] * share / counted;
            if (splatted == 0.0f) continue;
            Splat& splat = splats[static_cast<std::size_t>(first / packet)].emplace_back();
            sender_row(surface_, basis(), level_, hit, splat.row);
            const SurfacePoint y = surface_.point(hit);
            keep_seen(y, splat.row);
            const float flux = splatted * solid_angle / splatted_rays * shading_share(hit, y, rays[k - first].direction);
            splat.power = flux * light.intensity * surface_.reflectance(hit);
        }
    });
    const std::uint32_t begin = points_.begin(level_);
    for (const std::vector<Splat>& some : splats)
        for (const Splat& splat : some)
            for (const BasisEntry& entry : splat.row) {
                const std::size_t j = entry.index - begin;
                Rgb::Map(&result[3 * j]) += (entry.value / areas_[j]) * splat.power;
            }
}

} // namespace afterglow
