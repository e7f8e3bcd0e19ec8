#include "basis/shepard_basis.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

constexpr float behind_a_wall = 1e-4f;
constexpr float negligible = 1e-3f;  // beside what is in sight
/// Of a function's support: so far over the surface walls are looked for, so that mouldings and
/// roughness are none, unless something else is closer above it.
constexpr float lift_share = 0.02f;

} // namespace

ShepardBasis::ShepardBasis(const PointHierarchy& points, const Surface& surface, bool see_walls,
                           std::optional<int> only_level)
    : points_(points), surface_(surface), see_walls_(see_walls), level_(points.levels()) {
    for (int l = 0; l < points.levels(); ++l)
        if (!only_level || l == *only_level) prepare(l);
}

void ShepardBasis::prepare(int level) {
    const Index begin = points_.begin(level), count = points_.end(level) - points_.begin(level);
    Level& l = level_[level].emplace();
    l.tree = RTree(points_.position.middleCols(begin, count), points_.support.segment(begin, count),
                   points_.begin(level));
    if (level >= points_.openness_level) l.probe.emplace(surface_, points_.spacing[level]);
    l.nearest = std::make_unique<NearestPoints>(points_.position.middleCols(begin, count));
    if (!see_walls_ || count == 0) return;
    l.highest_lift = lift_share * points_.support.segment(begin, count).maxCoeff();
    l.lift.resize(static_cast<std::size_t>(count));
    parallel_for(count, [&](Index k) {
        const Index j = begin + k;
        l.lift[k] =
            std::max(free_lift(points_.point(j), lift_share * points_.support[j]), surface_.lift());
    }, 256);
}

float ShepardBasis::free_lift(const SurfacePoint& x, float wanted) const {
    const Hit above = surface_.closest_hit({surface_.lifted(x), x.normal, wanted});
    return above ? 0.5f * above.distance : wanted;
}

bool ShepardBasis::wall_between(int level, const SurfacePoint& x, float lift_of_x,
                                std::uint32_t j) const {
    const float lift = std::max(std::min(lift_of_x, lift_share * points_.support[j]), surface_.lift());
    const float lift_of_j = level_[level]->lift[j - points_.begin(level)];
    return surface_.blocked(x.position + lift * x.normal,
                            points_.position.col(j) + lift_of_j * points_.normal.col(j));
}

bool ShepardBasis::roofed(int level, const SurfacePoint& x, float spacings) const {
    return surface_.occluded({surface_.lifted(x), x.normal, spacings * points_.spacing[level]});
}

bool ShepardBasis::enclosed(int level, const SurfacePoint& x) const {
    if (level < points_.openness_level || !roofed(level, x, 0.5f)) return false;
    return is_enclosed(x.normal, (*level_[level]->probe)(x));
}

bool ShepardBasis::in_gap(int level, const SurfacePoint& x) const {
    if (level < points_.openness_level || !roofed(level, x)) return false;
    return far_openness(x.normal, (*level_[level]->probe)(x)) < 0.5f;
}

float ShepardBasis::weight(const SurfacePoint& x, std::uint32_t j, float reach) const {
    const Vec3 n = points_.normal.col(j);
    const float cosine = x.normal.dot(n);
    if (cosine <= 0.0f) return 0.0f;
    const float r = points_.support[j];
    const float d2 = squashed_distance2(x.position - points_.position.col(j), n);
    if (d2 >= (r + reach) * (r + reach)) return 0.0f;
    return kernel(std::max(0.0f, std::sqrt(d2) - reach) / r)
           * cosine_power(cosine, points_.shape.weight_power);
}

void ShepardBasis::evaluate(int level, const SurfacePoint& x, std::vector<BasisEntry>& row) const {
    const std::size_t first = row.size();
    append(level, x, 0.0f, row);
    make_sum_one(std::span(row).subspan(first));
}

bool ShepardBasis::append(int level, const SurfacePoint& x, float reach,
                          std::vector<BasisEntry>& row) const {
    const std::size_t first = row.size();
    bool in_sight = true;
    const auto add = [&](std::uint32_t j, float) {
        if (const float w = weight(x, j, reach); w > 1e-12f) row.push_back({j, w});
    };
    if (reach > 0.0f)
        level_[level]->tree.within(x.position, reach, add);
    else
        level_[level]->tree.containing(x.position, add);
    if (row.size() > first) {
        const auto candidates = std::span(row).subspan(first);
        if (level >= points_.openness_level && !favour_equal_openness(level, x, candidates)) {
            row.resize(first);
            return false;
        }
        if (see_walls_) row.resize(first + hide_behind_walls(level, x, candidates, in_sight));
    }
    const auto found = std::span(row).subspan(first);
    std::sort(found.begin(), found.end(),
              [](const BasisEntry& a, const BasisEntry& b) { return a.index < b.index; });
    return in_sight && !found.empty();
}

bool ShepardBasis::favour_equal_openness(int level, const SurfacePoint& x,
                                         std::span<BasisEntry> row) const {
    // On open ground all see the same, and x too: no need to look.
    const auto first = std::min_element(
        row.begin(), row.end(),
        [](const BasisEntry& a, const BasisEntry& b) { return a.index < b.index; });
    const Openness any = points_.openness_of(first->index);
    const bool alike = std::all_of(row.begin(), row.end(), [&](const BasisEntry& entry) {
        return openness_likeness(openness_difference2(points_.openness_of(entry.index), any)) > 0.98f;
    });
    // Unless x lies in a gap that none of them lies in.
    if (alike && !roofed(level, x, 0.5f)) return true;
    const Openness here = (*level_[level]->probe)(x);
    float most_alike = 0.0f;
    for (BasisEntry& entry : row) {
        const float likeness =
            openness_likeness(openness_difference2(points_.openness_of(entry.index), here));
        entry.value *= 1e-3f + likeness;
        most_alike = std::max(most_alike, likeness);
    }
    return most_alike > 0.01f || !is_enclosed(x.normal, here);
}

std::size_t ShepardBasis::hide_behind_walls(int level, const SurfacePoint& x,
                                            std::span<BasisEntry> row, bool& enough) const {
    const float lift = free_lift(x, level_[level]->highest_lift);
    std::sort(row.begin(), row.end(), [](const BasisEntry& a, const BasisEntry& b) {
        return a.value != b.value ? a.value > b.value : a.index < b.index;
    });
    float in_sight = 0.0f, hidden = 0.0f;
    for (BasisEntry& entry : row) {
        if (entry.value < negligible * in_sight) {
            entry.value = 0.0f;
        } else if (wall_between(level, x, lift, entry.index)) {
            hidden += entry.value;
            entry.value *= -behind_a_wall; // its sign marks it
        } else {
            in_sight += entry.value;
        }
    }
    enough = in_sight > 0.01f * hidden;
    if (in_sight == 0.0f && enclosed(level, x)) return 0;
    std::size_t kept = 0;
    for (const BasisEntry& entry : row)
        if (entry.value > 0.0f || (entry.value < 0.0f && !enough))
            row[kept++] = {entry.index, std::abs(entry.value)};
    return kept;
}

void ShepardBasis::evaluate_or_nearest(int level, const SurfacePoint& x,
                                       std::vector<BasisEntry>& row) const {
    const std::size_t first = row.size();
    if (!append(level, x, 0.0f, row)) take_nearest(level, x, first, row);
    make_sum_one(std::span(row).subspan(first));
}

void ShepardBasis::factors(int level, const SurfacePoint& x, float reach,
                           std::vector<BasisEntry>& found) const {
    const std::size_t first = found.size();
    if (!append(level, x, reach, found) && take_nearest(level, x, first, found)) return;
    for (BasisEntry& entry : std::span(found).subspan(first))
        entry.value /= weight(x, entry.index, reach);
}

void ShepardBasis::apply_factors(std::span<const BasisEntry> factors, const SurfacePoint& y,
                                 std::vector<BasisEntry>& row) const {
    const std::size_t first = row.size();
    for (const BasisEntry& entry : factors)
        if (const float w = weight(y, entry.index, 0.0f) * entry.value; w > 0.0f)
            row.push_back({entry.index, w});
    if (row.size() == first && !factors.empty()) {
        const auto distance2 = [&](const BasisEntry& entry) {
            const Index j = entry.index;
            return squashed_distance2(y.position - points_.position.col(j), points_.normal.col(j))
                   / (points_.support[j] * points_.support[j]);
        };
        const auto closest = std::min_element(factors.begin(), factors.end(),
                                              [&](const BasisEntry& a, const BasisEntry& b) {
                                                  return distance2(a) < distance2(b);
                                              });
        row.push_back({closest->index, 1.0f});
    }
    make_sum_one(std::span(row).subspan(first));
}

bool ShepardBasis::take_nearest(int level, const SurfacePoint& x, std::size_t first,
                                std::vector<BasisEntry>& row) const {
    if (row.size() == first && enclosed(level, x)) return false;
    const std::size_t before = row.size();
    if (!closest_in_sight(level, x, row)) return false;
    row.erase(row.begin() + static_cast<std::ptrdiff_t>(first),
              row.begin() + static_cast<std::ptrdiff_t>(before));
    return true;
}

bool ShepardBasis::closest_in_sight(int level, const SurfacePoint& x,
                                    std::vector<BasisEntry>& row) const {
    thread_local std::vector<std::uint32_t> near;
    const float farthest = 4.0f * points_.spacing[level];
    const float lift = see_walls_ ? free_lift(x, level_[level]->highest_lift) : 0.0f;
    std::size_t looked_at = 0;
    for (const int count : {4, 32}) { // four mostly do
        level_[level]->nearest->closest(x.position, count, near);
        for (; looked_at < near.size(); ++looked_at) {
            const std::uint32_t j = points_.begin(level) + near[looked_at];
            if ((x.position - points_.position.col(j)).norm() > farthest) return false; // closest first
            if (x.normal.dot(points_.normal.col(j)) <= 0.1f) continue;
            if (see_walls_ && wall_between(level, x, lift, j)) continue;
            row.push_back({j, 1.0f});
            return true;
        }
    }
    return false;
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
