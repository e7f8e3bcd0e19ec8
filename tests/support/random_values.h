#pragma once

#include "core/sampling.h"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace afterglow {

/// Uniform in [-0.3, 0.7).
inline std::vector<float> random_values(std::size_t count, std::uint64_t seed) {
    Rng rng(seed, 0);
    std::vector<float> values(count);
    for (float& v : values)
        v = rng.uniform() - 0.3f;
    return values;
}

} // namespace afterglow
