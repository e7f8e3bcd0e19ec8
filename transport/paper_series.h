#pragma once

#include "basis/pyramid.h"
#include "basis/shepard_basis.h"
#include "transport/rgb_links.h"

namespace afterglow {

/// The operator of several bounces as printed [LZT08, eq. (15), sec. 3.2]: S = T + T^2 + ..., stored.
/// From the second bounce on, the coarsest functions alone receive, and sums of links below the
/// threshold are truncated after each bounce:
///
///     S_1 = T,   S_b = T + T_0 P n.S_(b-1),
///
/// with T_0 the rows of the coarsest receivers, and P n. what turns vector coefficients into
/// coefficients of the senders' irradiance: the field at the senders, dotted with their normals,
/// pulled and analysed as direct light is. (The product T T has no meaning as printed: T takes
/// scalars to vectors.)
///
/// pyramid, pull: of the senders' levels, as for direct light.
RgbLinks make_paper_series(RgbLinks links, const ShepardBasis& basis, int sender_levels,
                           const Pyramid& pyramid, const PullOperator& pull, int bounces,
                           float threshold);

} // namespace afterglow
