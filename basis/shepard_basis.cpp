#include "basis/shepard_basis.h"

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

constexpr float behind_a_wall = 1e-4f;

} // namespace

ShepardBasis::ShepardBasis(const PointHierarchy& points, const Surface& surface, bool see_walls)
    : points_(points), surface_(surface), see_walls_(see_walls) {
    for (int l = 0; l < points.levels(); ++l) {
        const Index begin = points.begin(l), count = points.end(l) - points.begin(l);
        tree_.emplace_back(points.position.middleCols(begin, count), points.support.segment(begin, count),
                           points.begin(l));
        nearest_.push_back(std::make_unique<NearestPoints>(points.position.middleCols(begin, count)));
    }
}

bool ShepardBasis::wall_between(const SurfacePoint& x, std::uint32_t j) const {
    // Lifted a little, so that mouldings and roughness are no wall.
    const float lift = std::max(0.02f * points_.support[j], surface_.lift());
    return surface_.blocked(x.position + lift * x.normal,
                            points_.position.col(j) + lift * points_.normal.col(j));
}

void ShepardBasis::evaluate(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const {
    const std::size_t first = row.size();
    float sum = 0.0f;
    tree_[level].containing(x.position, [&](std::uint32_t j, float distance2) {
        const float cosine = x.normal.dot(points_.normal.col(j));
        if (cosine <= 0.0f) return;
        const float h = (x.position - points_.position.col(j)).dot(points_.normal.col(j));
        const float r = points_.support[j];
        const float d2 = distance2 + 8.0f * h * h;
        if (d2 >= r * r) return;
        const float w = kernel(std::sqrt(d2) / r) * cosine_power(cosine, points_.shape.weight_power);
        if (!(w > 1e-12f)) return;
        row.push_back({j, w});
        sum += w;
    });
    std::sort(row.begin() + first, row.end(),
              [](const BasisEntry& a, const BasisEntry& b) { return a.index < b.index; });
    if (see_walls_ && row.size() > first + 1) {
        sum = 0.0f;
        for (std::size_t k = first; k < row.size(); ++k) {
            if (wall_between(x, row[k].index)) row[k].value *= behind_a_wall;
            sum += row[k].value;
        }
    }
    for (std::size_t k = first; k < row.size(); ++k) row[k].value /= sum;
}

void ShepardBasis::evaluate_or_nearest(int level, const SurfacePoint& x,
                                       std::vector<BasisEntry>& row) const {
    const std::size_t first = row.size();
    evaluate(level, x, row);
    if (row.size() > first) return;
    std::vector<std::uint32_t> near;
    nearest_[level]->closest(x.position, 32, near);
    for (const std::uint32_t k : near) {
        const std::uint32_t j = points_.begin(level) + k;
        if (x.normal.dot(points_.normal.col(j)) <= 0.1f || wall_between(x, j)) continue;
        row.push_back({j, 1.0f});
        return;
    }
}

void make_sum_one(std::span<BasisEntry> row) {
    float sum = 0.0f;
    for (const BasisEntry& entry : row)
        sum += entry.value;
    for (BasisEntry& entry : row)
        entry.value /= sum;
}

void drop_small_shares(std::vector<BasisEntry>& row) {
    constexpr float least_share = 0.05f;
    std::erase_if(row, [](const BasisEntry& entry) { return entry.value < least_share; });
    make_sum_one(row);
}

} // namespace afterglow
