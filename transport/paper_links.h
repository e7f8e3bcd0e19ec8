#pragma once

#include "basis/shepard_basis.h"
#include "core/surface.h"
#include "transport/links.h"
#include "transport/rgb_links.h"

namespace afterglow {

/// Links of one bounce by the adaptive refinement as printed [LZT08, sec. 3.2, Fig. 5]:
///
///     T'_ij = (1/pi) int B_j(y(omega)) rho(y(omega)) omega domega,                     (16)
///     T_ij = T'_ij - sum_k B_k(x_i) T_kj,   k over all coarser receivers,              (17)
///
/// T_kj as stored. All levels are receivers; the first `sender_levels` are senders too, and a ray
/// sees the functions of all of them. From coarse to fine, a receiver is gathered if a link of one of
/// its parents was kept, or if it has no parents. A link is kept if its magnitude exceeds the
/// threshold and, unless the sender is on the coarsest level, the largest difference to the links of
/// that sender's neighbours does (if it has any). What is not kept is lost.
///
/// Beyond the print: the 1/pi that turns radiosity into radiance. Left open by it: options.rays for
/// every receiver, with the density of vector_irradiance_pdf().
///
/// options.threshold must be given. `basis` without the wall term.
RgbLinks make_paper_links(const Surface& surface, const ShepardBasis& basis, int sender_levels,
                          const LinkOptions& options, LinkStatistics& statistics);

} // namespace afterglow
