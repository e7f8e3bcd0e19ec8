#include "basis/point_hierarchy.h"

#include "basis/morton.h"
#include "basis/nearest_points.h"
#include "core/error.h"
#include "core/parallel.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>

namespace afterglow {
namespace {

/// Supports of a level whose density varies: a function reaches 1.5 times as far as its fourth
/// neighbour that faces about the same way, so that everywhere about as many overlap. Distances grow
/// with the difference in openness as weights fall with it: along a contact a function reaches its
/// like. `longest`: senders' supports are kept short, as direct light has shadow edges.
std::vector<float> adaptive_supports(const std::vector<Candidate>& points,
                                     std::span<const Openness> openness, float longest) {
    constexpr std::size_t neighbour = 4;
    constexpr int at_first = 12, at_most = 48; // closest points that are looked at
    Eigen::Matrix3Xf positions(3, points.size());
    for (std::size_t i = 0; i < points.size(); ++i) positions.col(i) = points[i].at.position;
    const NearestPoints nearest(positions);
    std::vector<float> support(points.size());
    parallel_for(static_cast<Index>(points.size()), [&](Index i) {
        const SurfacePoint& x = points[i].at;
        std::vector<std::uint32_t> near;
        std::vector<float> distance;
        for (int considered = at_first; considered <= at_most; considered *= 2) {
            nearest.closest(x.position, considered, near);
            distance.clear();
            for (const std::uint32_t j : near) {
                const Vec3& n = points[j].at.normal;
                if (j == static_cast<std::uint32_t>(i) || n.dot(x.normal) < 0.7f) continue;
                const float d2 = squashed_distance2(points[j].at.position - x.position, n);
                distance.push_back(std::sqrt(d2)
                                   / openness_likeness(openness_difference2(openness[j], openness[i])));
            }
            std::sort(distance.begin(), distance.end());
            // These distances are never shorter than the straight one, by which the points are found.
            const float fourth = distance.size() >= neighbour ? distance[neighbour - 1] : longest / 1.5f;
            const float farthest = (points[near.back()].at.position - x.position).norm();
            if (std::min(fourth, longest / 1.5f) < 0.999f * farthest) break;
        }
        support[i] = distance.size() >= neighbour ? std::min(1.5f * distance[neighbour - 1], longest)
                                                  : longest;
    });
    return support;
}

} // namespace

PointHierarchy build_hierarchy(CandidateSource& source, const HierarchyOptions& options,
                               HierarchyStatistics* statistics) {
    const auto start = std::chrono::steady_clock::now();
    if (options.finest_density > 0.0f && options.display && !(options.display->openness_density > 0.0f))
        throw UsageError("the display level must be placed by openness where the level before it is");
    PointHierarchy hierarchy;
    hierarchy.shape = options.shape;
    hierarchy.level_begin = {0};
    const int level_count = options.levels + (options.display ? 1 : 0);
    std::vector<std::vector<Candidate>> levels(level_count);
    std::vector<std::vector<float>> supports(level_count);
    std::vector<OpennessCode> openness;
    hierarchy.openness_level = level_count;
    for (int l = 0; l < level_count; ++l) {
        const DisplayLevel* display = l == options.levels ? &*options.display : nullptr;
        const float spacing = display ? display->spacing : std::ldexp(options.coarse_radius, -l);
        const float density = display                      ? display->openness_density
                              : l == options.levels - 1 ? options.finest_density
                                                        : 0.0f;
        const bool by_openness = density > 0.0f;
        PoissonDiskOptions disk_options;
        disk_options.spacing = spacing;
        disk_options.placement_power
            = by_openness ? options.shape.openness_placement_power : options.shape.placement_power;
        disk_options.skip_narrow = options.skip_narrow && !by_openness;
        disk_options.openness_density = density;
        disk_options.candidates_per_point = options.candidates_per_point;
        const PoissonDisk disk = poisson_disk(source, disk_options);

        std::vector<Openness> placed;
        std::vector<Vec3> positions;
        for (const Candidate& c : disk.points) positions.push_back(c.at.position);
        for (const std::uint32_t i : morton_order(positions)) {
            levels[l].push_back(disk.points[i]);
            if (by_openness) {
                placed.push_back(disk.openness[i]);
                openness.push_back(encode(disk.openness[i]));
            }
        }
        if (by_openness) {
            hierarchy.openness_level = std::min(hierarchy.openness_level, l);
            const float longest = (display ? 2.25f : 1.28f) * spacing;
            supports[l] = adaptive_supports(levels[l], placed, longest);
        } else {
            const float t = level_count > 1 ? static_cast<float>(l) / (level_count - 1) : 0.0f;
            const float reach = std::lerp(options.shape.reach_coarsest, options.shape.reach_finest, t);
            supports[l].assign(levels[l].size(), reach * spacing);
        }
        hierarchy.spacing.push_back(spacing);
        hierarchy.parent_level.push_back(display ? display->parent : l - 1);
        hierarchy.level_begin.push_back(hierarchy.level_begin.back()
                                        + static_cast<std::uint32_t>(levels[l].size()));
        if (statistics)
            statistics->level.push_back(
                {static_cast<std::uint32_t>(levels[l].size()), disk.candidates_tried});
        // A level takes about as long as all before it.
        if (options.progress) options.progress(std::ldexp(1.0, l + 1 - level_count));
    }
    const Index count = hierarchy.size();
    hierarchy.position.resize(3, count);
    hierarchy.normal.resize(3, count);
    hierarchy.support.resize(count);
    hierarchy.reflectance.resize(3, count);
    hierarchy.openness.resize(Eigen::NoChange, static_cast<Index>(openness.size()));
    for (std::size_t k = 0; k < openness.size(); ++k)
        hierarchy.openness.col(static_cast<Index>(k)) = openness[k];
    Index i = 0;
    for (int l = 0; l < level_count; ++l)
        for (std::size_t k = 0; k < levels[l].size(); ++k, ++i) {
            hierarchy.position.col(i) = levels[l][k].at.position;
            hierarchy.normal.col(i) = levels[l][k].at.normal;
            hierarchy.support[i] = supports[l][k];
            hierarchy.reflectance.col(i) = source.surface().reflectance(levels[l][k].hit).matrix();
        }
    if (statistics)
        statistics->seconds
            = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return hierarchy;
}

} // namespace afterglow
