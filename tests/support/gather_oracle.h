#pragma once

#include "basis/shepard_basis.h"
#include "core/surface.h"
#include "transport/gather.h"

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// Mean and standard error, one entry for each of several quantities.
struct MeanAndError {
    Eigen::ArrayXd mean, error;
};

/// Standard errors from the spread of independent repetitions: one column each.
MeanAndError over_repetitions(const Eigen::ArrayXXd& values);

/// Shares of a row that favours functions of the same reflectance as y's: the formula of
/// SenderRows.
void weigh_by_reflectance(const PointHierarchy& points, const Rgb& reflectance,
                          std::vector<BasisEntry>& row);

/// How a sender field looks from a place y that is seen from a distance: the value that is read
/// there, as weights of sender values. Levels are blended by the footprint; where a level has no
/// function at y, the next coarser speaks for it; on the finest, reflectance counts.
std::vector<BasisEntry> seen_field(const ShepardBasis& basis, const Footprint& footprint,
                                   const SurfacePoint& y, const Rgb& reflectance, double distance,
                                   double cosine);

/// The gather of links.h by plain Monte Carlo: independent cosine-distributed rays, the basis
/// evaluated where they end, no patches. Irradiance by one unit of each sender *value*,
///
///     n . T_j = (1/pi) int cos(theta) W_j(y(omega)) domega,
///
/// then functional . T for each column of `functionals` (a value a sender). Unbiased.
MeanAndError irradiance_by_plain_gather(const Surface& surface, const ShepardBasis& basis,
                                        const Footprint& footprint, const SurfacePoint& receiver,
                                        const Eigen::MatrixXd& functionals, int rays,
                                        std::uint64_t seed);

} // namespace afterglow
