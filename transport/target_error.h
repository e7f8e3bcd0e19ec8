#pragma once

namespace afterglow {

/// LinkOptions::threshold for an asked relative error of the indirect irradiance: what is dropped
/// is a sum of many links of either sign, each below the threshold, so that the error grows in
/// proportion to it. A tenth of error is a threshold of a thousandth.
inline float threshold_for_error(double target_error) {
    return static_cast<float>(0.01 * target_error);
}

} // namespace afterglow
