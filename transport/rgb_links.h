#pragma once

#include "basis/sparse_rows.h"

#include <Eigen/Core>

#include <cmath>

namespace afterglow {

/// Vector irradiance by one unit of irradiance, per colour, the sender's reflectance inside
/// [LZT08, eq. (16)]: x.R, x.G, x.B, y.R ... without a unit.
using RgbLink = Eigen::Array<float, 9, 1>;

/// A row a receiver, senders rising.
using RgbLinks = SparseRows<RgbLink>;

/// The magnitude of a link that thresholds look at: the root of the mean over the colours of its
/// vectors' squared lengths.
inline float magnitude(const RgbLink& link) {
    return std::sqrt(link.square().sum() / 3.0f);
}

} // namespace afterglow
