#pragma once

#include "core/types.h"

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace afterglow {

/// How many samples an estimate takes, and of what quality it has to be.
struct EstimatorOptions {
    Index samples = 1024; // an item, rounded up to a multiple of `batches`
    double target_error =
        0.0; // if > 0: as many samples as bring every output's relative error below
    Index max_samples = 1 << 22; // mean number an item, the pilot's apart, at which a run for target_error gives up
    int batches = 16; // independent repetitions from which the error is estimated, at least 2
    std::uint64_t seed = 1;
    std::function<void(double)> progress = {}; // called now and then with the share that is done
};

/// Adds the samples first ... first + count - 1 of the sequence `seed` to sums[0 ... outputs - 1].
/// Called concurrently. Returns how many rays it traced.
using Sampler = std::function<std::uint64_t(Index item, std::uint64_t seed, Index first,
                                            Index count, std::span<Eigen::Array3d> sums)>;

/// Means of many random variables with their standard errors. Column item * outputs + output.
struct MeanEstimate {
    Eigen::Array3Xf mean;
    Eigen::Array3Xf standard_error;      // of the mean, from the spread of the batches
    std::vector<double> relative_error;  // an output each: sqrt(mean squared standard error) / mean
    std::uint64_t samples = 0, rays = 0; // all that were taken
};

/// Each of the batches of an item follows a randomised sequence of its own, so that their spread
/// measures the error of quasi-random samples too, to which a sample variance is blind.
///
/// For a target error, a pilot of 128 samples an item (also where `max_samples` is less: a smaller one knows
/// too little of s_i to pay), whose samples are then thrown away (with them, items whose first
/// samples happened to be small would get few more of them and the means were biased) gives the
/// standard deviation s_i of each item; N samples in all are shared out as n_i ~ s_i, which has the
/// least sum of s_i^2 / n_i (Neyman 1934). N grows until the measured error is small enough; that
/// this is decided by all items together is a bias far below the error itself. An output of which nothing was found is
/// given up for dark, with an error of zero, after 2^20 samples of all items.
MeanEstimate estimate_means(Index items, Index outputs, const Sampler& sampler,
                            const EstimatorOptions& options);

} // namespace afterglow
