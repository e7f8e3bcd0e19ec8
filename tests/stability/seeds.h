#pragma once

#include "tests/stability/transformations.h"
#include "transport/precompute.h"

#include <cstdint>
#include <vector>

namespace afterglow {

/// Indirect irradiance [W/m^2] at the P places of a setting, column l * P + p for light l and place
/// p, by one operator a seed.
using OfSeeds = std::vector<Eigen::Array3Xf>;

/// Precomputes for the seeds first, first + 1, ...
OfSeeds indirect_of_seeds(const Setting& setting, std::uint64_t first, int count,
                          PrecomputeOptions options = {});

/// How far the results of two settings that describe the same are from each other, relative to the
/// mean irradiance. Root mean squares over lights, places and colours.
struct Difference {
    double size = 0.0;           // of the difference of the means over the seeds
    double standard_error = 0.0; // of such a difference, were the two of independent seeds
    double bias = 0.0;           // mean of the difference
    double in_errors() const { return size / standard_error; }
};

/// `other` are the results of the first seeds of `base` in another setting, and compared with
/// those; all of `base`, at least two, tell the spread. The yardstick is the spread of `base`
/// alone: a result that has become noisy does not excuse itself.
Difference difference(const OfSeeds& base, const OfSeeds& other);

} // namespace afterglow
