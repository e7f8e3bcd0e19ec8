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
/// hit is a few operations away. Both sides of a cell have ids of their own: 2 * cell + back side.
class PatchGrid {
public:
    /// Keeps a reference. size: largest length of a cell along the triangle's first two edges [world].
    PatchGrid(const Scene& scene, float size);

    std::uint32_t patch_count() const { return count_; }
    std::uint32_t patch_of(const Hit& hit) const {
        const Cells& c = cells_[hit.primitive];
        const auto i = std::min<std::uint32_t>(c.along_u - 1u, static_cast<std::uint32_t>(hit.u * c.along_u));
        const auto j = std::min<std::uint32_t>(c.along_v - 1u, static_cast<std::uint32_t>(hit.v * c.along_v));
        return 2 * (c.first + j * c.along_u + i) + static_cast<std::uint32_t>(hit.back_side);
    }
    /// The place that stands for a patch, the centroid of its part of the triangle, as a hit on it.
    Hit center(std::uint32_t patch) const;
    /// The corners of the patch's part of the triangle, as hits, drawn in towards the centre by a
    /// fiftieth; two may be the same.
    std::array<Hit, 4> corners(std::uint32_t patch) const;
    /// Area of the patch's part of its triangle [world^2].
    float area(std::uint32_t patch) const;

private:
    struct Cells {
        std::uint32_t first;
        std::uint16_t along_u, along_v;
    };
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

    const Scene& scene_;
    std::vector<Cells> cells_; // a triangle each
    std::uint32_t count_ = 0;
};

} // namespace afterglow
