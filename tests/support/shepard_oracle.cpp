#include "tests/support/shepard_oracle.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

bool behind_a_wall(const PointHierarchy& points, const Surface& surface, const SurfacePoint& x,
                   std::uint32_t j) {
    const auto lifted = [&](const SurfacePoint& p) -> Vec3 {
        float lift = 0.02f * points.support[j];
        if (const Hit above = surface.closest_hit({surface.lifted(p), p.normal, lift}))
            lift = 0.5f * above.distance;
        return p.position + std::max(lift, surface.lift()) * p.normal;
    };
    return surface.blocked(lifted(x), lifted(points.point(j)));
}

std::map<std::uint32_t, double> shepard_by_formula(const PointHierarchy& points, int level,
                                                   const SurfacePoint& x, const Surface* surface,
                                                   bool see_walls) {
    std::map<std::uint32_t, double> all;
    for (std::uint32_t j = points.begin(level); j < points.end(level); ++j) {
        const Eigen::Vector3d offset =
            x.position.cast<double>() - points.position.col(j).cast<double>();
        const Eigen::Vector3d n = points.normal.col(j).cast<double>();
        const double cosine = n.dot(x.normal.cast<double>());
        const double h = offset.dot(n);
        const double t = std::sqrt(offset.squaredNorm() + 8.0 * h * h) / points.support[j];
        if (cosine <= 0.0 || t >= 1.0) continue;
        const double w =
            (2.0 * t * t * t - 3.0 * t * t + 1.0) * std::pow(cosine, points.shape.weight_power);
        all[j] = w;
    }
    if (surface && level >= points.openness_level && all.size() > 1) {
        const auto difference2 = [&](std::uint32_t j, const Openness& feature) {
            const auto code = points.openness.col(j - points.begin(points.openness_level));
            return static_cast<double>((code.cast<float>() / 64.0f - feature).squaredNorm());
        };
        const Openness first = points.openness_of(all.begin()->first);
        const bool alike = std::all_of(all.begin(), all.end(), [&](const auto& function) {
            return difference2(function.first, first) < 0.0225 * std::log(1.0 / 0.98);
        });
        const Openness here = OpennessProbe(*surface, points.spacing[level])(x);
        for (auto& [j, w] : all)
            if (!alike) w *= 1e-3 + std::exp(-difference2(j, here) / 0.0225);
    }
    std::map<std::uint32_t, double> weight, hidden;
    double in_sight = 0.0, behind_walls = 0.0;
    for (const auto& [j, w] : all) {
        const bool is_hidden =
            surface && see_walls && all.size() > 1 && behind_a_wall(points, *surface, x, j);
        (is_hidden ? hidden : weight)[j] = w;
        (is_hidden ? behind_walls : in_sight) += w;
    }
    if (in_sight <= 0.01 * behind_walls)
        for (const auto& [j, w] : hidden)
            weight[j] = 1e-4 * w;
    double sum = 0.0;
    for (const auto& [j, w] : weight)
        sum += w;
    for (auto& [j, w] : weight)
        w /= sum;
    return weight;
}

} // namespace afterglow
