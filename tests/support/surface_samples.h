#pragma once

#include "core/scene.h"
#include "core/surface.h"

#include <cstdint>
#include <vector>

namespace afterglow {

/// Points uniform over a scene's area, on the side of the triangles' winding; stratified, so that
/// the k-th point is uniform over the k-th part of the area.
std::vector<SurfacePoint> points_by_area(const Scene& scene, int count, std::uint64_t seed);

/// Where rays in uniform directions from `from` end, in no order; rays that leave the scene leave
/// no point. What an eye there sees.
std::vector<SurfacePoint> points_in_sight(const Surface& surface, const Vec3& from, int rays,
                                          std::uint64_t seed);

/// A square in the plane y = 0, seen from above, of the given half side about the origin.
Scene make_ground(float half_side);

/// The quarter-planes y = 0 and x = 0 of a right-angled corner along the z axis, up to `size`.
Scene make_corner(float size);

} // namespace afterglow
