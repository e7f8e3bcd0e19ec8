#include "basis/openness.h"

#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

namespace afterglow {

OpennessCode encode(const Openness& openness) {
    return (64.0f * openness).array().round().max(-127.0f).min(127.0f).cast<std::int8_t>();
}

OpennessProbe::OpennessProbe(const Surface& surface, float spacing, int rays)
    : surface_(surface), spacing_(spacing), directions_(3, rays) {
    // Neighbouring directions of a half share a ray packet: order by sector, then by height.
    std::vector<Vec2> u(rays);
    for (int k = 0; k < rays; ++k) u[k] = scrambled_sobol2(k, 11);
    const auto before = [](const Vec2& a, const Vec2& b) {
        const int sa = static_cast<int>(a.y() * 4), sb = static_cast<int>(b.y() * 4);
        return sa != sb ? sa < sb : a.x() < b.x();
    };
    std::sort(u.begin(), u.begin() + rays / 2, before);
    std::sort(u.begin() + rays / 2, u.end(), before);
    for (int k = 0; k < rays; ++k) directions_.col(k) = sample_vector_irradiance(u[k]);
}

Openness OpennessProbe::first_half(const SurfacePoint& x) const {
    return estimate(x, 0, directions_.cols() / 2);
}

Openness OpennessProbe::completed(const SurfacePoint& x, const Openness& first_half) const {
    const Index half = directions_.cols() / 2, all = directions_.cols();
    const float share = static_cast<float>(half) / static_cast<float>(all);
    return share * first_half + (1.0f - share) * estimate(x, half, all);
}

Openness OpennessProbe::estimate(const SurfacePoint& x, Index first, Index last) const {
    constexpr Index most = 64;
    std::array<Ray, most> rays;
    std::array<Hit, most> hits;
    const Frame frame(x.normal);
    const Vec3 origin = surface_.lifted(x);
    Openness sum = Openness::Zero();
    for (Index begin = first; begin < last; begin += most) {
        const Index count = std::min(most, last - begin);
        for (Index k = 0; k < count; ++k)
            rays[k] = {origin, frame.to_world(directions_.col(begin + k)), 16.0f * spacing_};
        surface_.closest_hits(std::span(rays).first(count), std::span(hits).first(count));
        for (Index k = 0; k < count; ++k) {
            const float weight = 2.0f / (directions_(2, begin + k) + 0.5f);
            // exp(-t/D) for the longest D; the next, a quarter as long, has its fourth power.
            float near = hits[k] ? std::exp(-hits[k].distance / (4.0f * spacing_)) : 0.0f;
            for (int d = openness_distances - 1; d >= 0; --d) {
                sum.segment<3>(3 * d) += weight * (1.0f - near) * rays[k].direction;
                near = near * near * near * near;
            }
        }
    }
    sum /= static_cast<float>(last - first);
    for (int d = 0; d < openness_distances; ++d) sum.segment<3>(3 * d) -= x.normal;
    return sum;
}

} // namespace afterglow
