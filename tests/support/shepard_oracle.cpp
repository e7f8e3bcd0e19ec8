#include "tests/support/shepard_oracle.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

bool behind_a_wall(const PointHierarchy& points, const Surface& surface, const SurfacePoint& x,
                   std::uint32_t j) {
    const float lift = std::max(0.02f * points.support[j], surface.lift());
    return surface.blocked(x.position + lift * x.normal,
                           points.position.col(j) + lift * points.normal.col(j));
}

std::map<std::uint32_t, double> shepard_by_formula(const PointHierarchy& points, int level,
                                                   const SurfacePoint& x, const Surface* surface) {
    std::map<std::uint32_t, double> weight;
    double sum = 0.0;
    for (std::uint32_t j = points.begin(level); j < points.end(level); ++j) {
        const Eigen::Vector3d offset =
            x.position.cast<double>() - points.position.col(j).cast<double>();
        const Eigen::Vector3d n = points.normal.col(j).cast<double>();
        const double cosine = n.dot(x.normal.cast<double>());
        const double h = offset.dot(n);
        const double t = std::sqrt(offset.squaredNorm() + 8.0 * h * h) / points.support[j];
        if (cosine <= 0.0 || t >= 1.0) continue;
        double w =
            (2.0 * t * t * t - 3.0 * t * t + 1.0) * std::pow(cosine, points.shape.weight_power);
        if (surface && behind_a_wall(points, *surface, x, j)) w *= 1e-4;
        weight[j] = w;
        sum += w;
    }
    for (auto& [j, w] : weight)
        w /= sum;
    return weight;
}

} // namespace afterglow
