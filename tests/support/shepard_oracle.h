#pragma once

#include "basis/point_hierarchy.h"
#include "core/surface.h"

#include <cstdint>
#include <map>

namespace afterglow {

/// The formula of ShepardBasis, one function after the other, in double precision:
///
///     B_j(x) = w_j / sum_k w_k,   w_j = K(d_j / r_j) max(0, n . n_j)^p o_j v_j
///
/// d_j^2 = |x - x_j|^2 + 8 ((x - x_j) . n_j)^2 and K(t) = 2 t^3 - 3 t^2 + 1. On a level with
/// openness o_j = 10^-3 + exp(-|dF|^2 / 0.0225), unless the features of all functions are within
/// |dF|^2 < 0.0225 ln(1 / 0.98) of the first one's; else 1. v_j = 10^-4 where the segment between
/// both points, lifted by 0.02 r_j along their normals or half way to what is closer, is blocked, or 0 if functions in sight have
/// more than a hundredth of the weight of those behind walls; else 1, as without `see_walls`.
/// Functions whose weight is zero are left out. `surface` null: o_j = v_j = 1.
std::map<std::uint32_t, double> shepard_by_formula(const PointHierarchy& points, int level,
                                                   const SurfacePoint& x, const Surface* surface,
                                                   bool see_walls = true);

/// True where something stands between x and the centre of function j, as above.
bool behind_a_wall(const PointHierarchy& points, const Surface& surface, const SurfacePoint& x,
                   std::uint32_t j);

} // namespace afterglow
