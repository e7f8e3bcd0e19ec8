#pragma once

#include "core/scene.h"

#include <array>
#include <cstdint>

namespace afterglow {

/// Adds a quad of two triangles, 0 1 2 and 0 2 3, seen from where its corners run counter-clockwise.
inline void add_quad(Scene& scene, const std::array<Vec3, 4>& corner, std::uint32_t material = 0) {
    const auto first = static_cast<std::uint32_t>(scene.positions.size());
    scene.positions.insert(scene.positions.end(), corner.begin(), corner.end());
    scene.triangles.push_back({first, first + 1, first + 2});
    scene.triangles.push_back({first, first + 2, first + 3});
    scene.material_index.insert(scene.material_index.end(), 2, material);
}

} // namespace afterglow
