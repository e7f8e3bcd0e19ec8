#pragma once

#include "core/types.h"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// Cuts a polygon, convex or not, flat or nearly so, into corner.size() - 2 triangles that keep its
/// winding, appended to `triangles` as positions in `corner`. A quadrilateral is cut along its
/// shorter inner diagonal, others by clipping ears. A polygon that crosses itself still gives
/// triangles between its corners. corner.size() >= 3; all finite.
void triangulate(std::span<const Vec3> corner,
                 std::vector<std::array<std::uint32_t, 3>>& triangles);

} // namespace afterglow
