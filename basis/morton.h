#pragma once

#include "core/types.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// The place of a cell on a Morton curve: the lowest 21 bits of x, y and z by turns.
std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z);

/// The order of positions along a Morton curve over their bounding box (21 bits an axis); ties by id.
std::vector<std::uint32_t> morton_order(std::span<const Vec3> positions);

} // namespace afterglow
