#pragma once

#include "transport/links.h"

namespace afterglow {

/// The relative error that the default threshold of links stands for.
inline constexpr double default_target_error = 0.1;

/// LinkOptions::threshold for an asked relative error of the indirect irradiance. What is dropped is
/// a sum of links each below the threshold, so the error is taken to grow in proportion to it.
inline float threshold_for_error(double target_error) {
    return static_cast<float>(LinkOptions().threshold * target_error / default_target_error);
}

} // namespace afterglow
