#pragma once

#include <Eigen/Core>

#include <cstdint>

namespace afterglow {

/// How far x is from the reference y over K samples (points or covered pixels).
struct Measures {
    std::int64_t samples = 0;
    double reference_mean = 0;           // over samples and channels
    double rel_rmse = 0;                 // sqrt(mean (x - y)^2) / mean y
    double rel_l1 = 0;                   // mean |x - y| / mean y
    double bias = 0;                     // mean (x - y) / mean y
    double median = 0, p95 = 0, p99 = 0; // of |x - y| / (y + .01 mean y), one value a sample
};

/// x, y: 3 x K. Means run over samples and channels; for the percentiles |x - y| and y are averaged
/// over the channels of a sample first. A percentile q is the smallest value that at least the
/// share q of the samples does not exceed. Throws Error where the sizes differ, there are no
/// samples, a value is not finite or the reference is black.
Measures measure(const Eigen::Array3Xf& x, const Eigen::Array3Xf& y);

} // namespace afterglow
