#pragma once

#include "basis/point_hierarchy.h"
#include "basis/push.h"
#include "transport/transfer_operator.h"

#include <cstdint>
#include <span>

namespace afterglow {

/// Irradiance below zero at points of the display level, which dropped links leave beside hard shadows and
/// in the dark, is raised to zero, and what that adds is taken from the points around, so that no light
/// is made or lost (after the limiters of Zhang and Shu 2010). With E_j = n_j . V_j of one colour and
/// w_jk the parents of j,
///
///     D_k = sum_j w_jk max(0, -E_j),   P_k = sum_j w_jk max(0, E_j),
///     E_j <- max(0, E_j) (1 - min(1, sum_k w_jk D_k / P_k)):
///
/// sum_j w_jk E_j stays what it was for each parent k, unless it was below zero itself. V_j changes along
/// n_j alone. `field`: nine numbers a point, as VectorIrradiance, in place. Costs next to nothing where
/// nothing is negative.
void make_positive(const PointHierarchy& points, const PushOperator& push, VectorIrradiance& field);

/// The same where it is known already at which points of the display level, in their order, it is below
/// zero.
void make_positive(const PointHierarchy& points, const PushOperator& push, std::span<const std::uint8_t> is_negative,
                   VectorIrradiance& field);

} // namespace afterglow
