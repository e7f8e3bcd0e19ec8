#pragma once

#include "basis/point_hierarchy.h"
#include "core/surface.h"

#include <cstdint>
#include <map>

namespace afterglow {

/// The formula of ShepardBasis, one function after the other, in double precision:
///
///     B_j(x) = w_j / sum_k w_k,   w_j = K(d_j / r_j) max(0, n . n_j)^p v_j
///
/// d_j^2 = |x - x_j|^2 + 8 ((x - x_j) . n_j)^2, K(t) = 2 t^3 - 3 t^2 + 1, and v_j = 10^-4 where the
/// segment between both points, lifted by 0.02 r_j along their normals, is blocked. Functions whose
/// weight is zero are left out. `surface` null: no walls.
std::map<std::uint32_t, double> shepard_by_formula(const PointHierarchy& points, int level,
                                                   const SurfacePoint& x, const Surface* surface);

/// True where something stands between x and the centre of function j, as above.
bool behind_a_wall(const PointHierarchy& points, const Surface& surface, const SurfacePoint& x,
                   std::uint32_t j);

} // namespace afterglow
