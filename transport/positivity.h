#pragma once

#include "basis/point_hierarchy.h"
#include "basis/push.h"
#include "transport/transfer_operator.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// Irradiance below zero at points of the display level, which dropped links leave beside hard shadows and
/// in the dark, is raised to zero, and what that adds is taken from the points around, so that no light
/// is made or lost (after the limiters of Zhang and Shu 2010). With E_j = n_j . V_j of one colour and
/// w_jk the parents of j,
///
///     D_k = sum_j w_jk max(0, -E_j),   P_k = sum_j w_jk max(0, E_j),
///     E_j <- max(0, E_j) (1 - min(1, sum_k w_jk D_k / P_k)):
///
/// sum_j E_j stays what it was, as sum_k w_jk = 1, but for what is missing where there is too little to
/// take it from (the last sum above one, or P_k zero). V_j changes along n_j alone. `field`: nine numbers a
/// point, as VectorIrradiance, in place. Costs next to nothing where nothing is negative.
void make_positive(const PointHierarchy& points, const PushOperator& push, VectorIrradiance& field);

/// The same for one hierarchy again and again, where it is known already which points of the display level
/// are below zero: it reads the light of no others than these and those that they take from.
class PositivityLimiter {
public:
    /// Keeps references.
    PositivityLimiter(const PointHierarchy& points, const PushOperator& push);
    /// `negative`: the points, rising.
    void operator()(std::span<const std::uint32_t> negative, VectorIrradiance& field);

private:
    const PointHierarchy& points_;
    const PushOperator& push_;
    /// A point of the display level below a parent, with its share.
    struct Child {
        std::uint32_t point;
        float weight;
    };
    std::uint32_t first_parent_, first_point_; // what the following are counted from
    std::vector<std::uint32_t> child_begin_;   // a parent each, and the end
    std::vector<Child> child_;
    // A parent each: whether any of its points is below zero, and what all lose of their irradiance; a point
    // each: whether it has such a parent. Zero between calls.
    std::vector<std::uint8_t> is_asked_;
    std::vector<Rgb> share_;
    std::vector<std::uint8_t> changes_;
};

} // namespace afterglow
