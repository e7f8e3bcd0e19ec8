#pragma once

#include "transport/transfer_operator.h"

#include <span>

namespace afterglow {

/// Irradiance below zero, which no light makes: of functions that are coarse for the edge of a
/// shadow, or of noise.
struct Ringing {
    double negative_share = 0.0; // of the places where a colour is negative
    double largest = 0.0; // size of the most negative, relative to the mean of what is positive
};

/// n . sum_j B_j V_j at the places, 3 x places [W/m^2]: what Display clamps. Zero where no function
/// covers a place.
Eigen::Array3Xf unclamped_irradiance(const Surface& surface, const TransferOperator& transfer,
                                     const Spotlight& light, std::span<const SurfacePoint> places);

Ringing ringing_of(const Eigen::Array3Xf& unclamped);

} // namespace afterglow
