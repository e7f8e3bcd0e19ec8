#pragma once

#include "core/types.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// The order of positions along a Morton curve over their bounding box (21 bits an axis); ties by id.
std::vector<std::uint32_t> morton_order(std::span<const Vec3> positions);

} // namespace afterglow
