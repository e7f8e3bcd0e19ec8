#pragma once

#include "basis/shepard_basis.h"
#include "basis/sparse_rows.h"
#include "core/surface.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace afterglow {

/// Cuts every triangle into parallelogram cells no longer than a given size, so that the cell of a
/// hit is a few operations away. Triangles with no edge longer than half the size share a cell with
/// others like them: those whose centroids lie in one cube three quarters of the size long, whose normals
/// are within some 20 degrees and whose material is the same; so that cells become no more than the
/// surface needs, however fine its triangles. Of a triangle with edges of more than 1024 cells, or of more than
/// 16 and not within the box that is used (the ground that a room stands on), only what lies in that box has cells of its own; what is beyond counts to
/// those at the box's border. Both sides of a cell have ids of their own: 2 * cell +
/// back side.
class PatchGrid {
public:
    /// Keeps a reference. size: largest length of a cell along the triangle's first two edges [world].
    PatchGrid(const Scene& scene, float size, const Eigen::AlignedBox3f& used);
    PatchGrid(const Scene& scene, float size) : PatchGrid(scene, size, scene.bounds()) {}

    std::uint32_t patch_count() const { return count_; }
    std::uint32_t patch_of(const Hit& hit) const {
        const Cells& c = cells_[hit.primitive];
        if (c.along_u == 0) return patch_in(windows_[c.first], hit);
        const auto i = std::min<std::uint32_t>(c.along_u - 1u, static_cast<std::uint32_t>(hit.u * c.along_u));
        const auto j = std::min<std::uint32_t>(c.along_v - 1u, static_cast<std::uint32_t>(hit.v * c.along_v));
        return 2 * (c.first + j * c.along_u + i) + static_cast<std::uint32_t>(hit.back_side);
    }
    /// The place that stands for a patch, the centroid of its part of the triangle, as a hit on it; of
    /// several triangles, the centroid of that in their middle.
    Hit center(std::uint32_t patch) const;
    /// The corners of the patch's part of the triangle that holds the centre, as hits, drawn in towards
    /// the centre by a fiftieth; two may be the same.
    std::array<Hit, 4> corners(std::uint32_t patch) const;
    /// How high the surface may rise between two places of the patch [world]: nothing where it is flat.
    float relief(std::uint32_t patch) const { return patch / 2 >= first_shared_ ? 0.1f * size_ : 0.0f; }
    /// Area of the patch [world^2].
    float area(std::uint32_t patch) const;

private:
    struct Cells {
        std::uint32_t first;            // where along_u is 0, of windows_
        std::uint16_t along_u, along_v;
    };
    /// Of the cells of a triangle, `along` its edges, those from `begin` on have numbers.
    struct Window {
        std::uint32_t first, along_u, along_v, begin_u, begin_v, count_u, count_v;
    };
    static std::uint32_t patch_in(const Window& w, const Hit& hit);
    Window window_of(std::uint32_t triangle) const;
    Window used_window(const Vec3& a, const Vec3& ab, const Vec3& ac, const Eigen::AlignedBox3f& used) const;
    /// The triangle of a patch, and the patch's column and row in it.
    struct Location {
        std::uint32_t triangle, i, j;
    };
    Location locate(std::uint32_t patch) const;
    /// A cell's part of its triangle: the share of the triangle's area, the centroid's weights.
    struct Part {
        double share = 0.0, u = 0.0, v = 0.0;
    };
    Part part(const Location& at) const;
    float area_of(std::uint32_t triangle) const;
    /// Gives triangles that are small their cells, from first_shared_ on.
    void share_cells(const std::vector<std::uint32_t>& small);

    /// A cell that triangles share.
    struct Shared {
        std::uint32_t middle; // the triangle that stands for it
        float area;
    };

    const Scene& scene_;
    float size_;
    std::vector<Cells> cells_;          // a triangle each
    std::vector<Window> windows_;
    std::vector<std::uint32_t> large_;  // the triangles with cells of their own, rising as their cells do
    std::uint32_t first_shared_ = 0;
    std::vector<Shared> shared_;        // the cells from first_shared_ on
    std::uint32_t count_ = 0;
};

} // namespace afterglow
