#pragma once

#include "basis/candidates.h"
#include "basis/openness.h"
#include "basis/poisson_disk.h"
#include "basis/shepard.h"

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

namespace afterglow {

/// The N points that carry the basis, in L levels, coarse to fine; within a level in Morton order.
/// Function i has its centre at point i.
struct PointHierarchy {
    Eigen::Matrix3Xf position;              // 3 x N, world space
    Eigen::Matrix3Xf normal;                // 3 x N, unit length
    Eigen::VectorXf support;                // N, radius outside which the weight is zero [world]
    Eigen::Matrix3Xf reflectance;           // 3 x N, of the surface at the point
    std::vector<std::uint32_t> level_begin; // L + 1; level l is [level_begin[l], level_begin[l + 1])
    std::vector<float> spacing;             // L, the Poisson-disk radius R_l [world]
    std::vector<int> parent_level;          // L, the coarser level that predicts it; -1 for none
    /// The levels from this one on were placed by openness, whose features their points have; L
    /// or beyond where none was.
    int openness_level = std::numeric_limits<int>::max();
    Eigen::Matrix<std::int8_t, 3 * openness_distances, Eigen::Dynamic> openness; // OpennessCode each
    BasisShape shape;

    int levels() const { return static_cast<int>(spacing.size()); }
    std::uint32_t size() const { return level_begin.back(); }
    std::uint32_t begin(int level) const { return level_begin[level]; }
    std::uint32_t end(int level) const { return level_begin[level + 1]; }
    /// Whether a level is the last, which is displayed, or predicts it, through others or itself.
    bool leads_to_display(int level) const {
        return level <= parent_level.back() || level + 1 == levels();
    }
    Openness openness_of(Index i) const {
        return decode(openness.col(i - begin(openness_level)));
    }
    SurfacePoint point(Index i) const { return {position.col(i), normal.col(i)}; }
};

/// A last level, for display: its points lie denser where the openness feature changes.
struct DisplayLevel {
    float spacing = 0.0f;         // R on open ground [world]
    int parent = 0;               // the level that predicts it
    float openness_density = 0.15f; // s of PoissonDiskOptions; 0 for a plain level
};

struct HierarchyOptions {
    float coarse_radius = 0.0f; // R of level 0 [world]; halves from level to level
    int levels = 4;             // the display level not counted
    float finest_density = 0.0f; // s of the finest of these, as a display level has one
    std::optional<DisplayLevel> display = {};
    BasisShape shape = {};
    bool skip_narrow = true; // on every level but an openness level
    int candidates_per_point = PoissonDiskOptions{}.candidates_per_point;
    std::function<void(double)> progress = {}; // is told the share of the work that is done
};

struct LevelStatistics {
    std::uint32_t points = 0;
    std::uint64_t candidates_tried = 0;
};

struct HierarchyStatistics {
    std::vector<LevelStatistics> level;
    double seconds = 0.0;
};

/// Builds the hierarchy from the source's candidates [LZT08, sec. 2.3]. Throws UsageError where the display
/// level is plain and the finest before it is not.
PointHierarchy build_hierarchy(CandidateSource& source, const HierarchyOptions& options,
                               HierarchyStatistics* statistics = nullptr);

} // namespace afterglow
