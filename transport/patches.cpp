#include "transport/patches.h"

#include "core/error.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

PatchGrid::PatchGrid(const Scene& scene, float size) : cells_(scene.triangles.size()) {
    constexpr float most_along = 1024.0f;
    std::uint64_t cells = 0;
    for (std::size_t t = 0; t < cells_.size(); ++t) {
        const Triangle& corner = scene.triangles[t];
        const Vec3& a = scene.positions[corner[0]];
        const auto along = [&](const Vec3& b) {
            return static_cast<std::uint16_t>(std::clamp(std::ceil((b - a).norm() / size), 1.0f, most_along));
        };
        cells_[t] = {static_cast<std::uint32_t>(cells), along(scene.positions[corner[1]]),
                     along(scene.positions[corner[2]])};
        cells += static_cast<std::uint64_t>(cells_[t].along_u) * cells_[t].along_v;
        if (cells > 0x7fffffffu / 2)
            throw Error("the scene needs more than 10^9 surface patches of size "
                        + std::to_string(size) + "; choose a larger --coarse-radius");
    }
    count_ = static_cast<std::uint32_t>(2 * cells);
}

Hit PatchGrid::center(std::uint32_t patch) const {
    const std::uint32_t cell = patch / 2;
    const auto next = std::upper_bound(cells_.begin(), cells_.end(), cell,
                                       [](std::uint32_t c, const Cells& cells) { return c < cells.first; });
    const Cells& c = *(next - 1);
    const std::uint32_t j = (cell - c.first) / c.along_u, i = (cell - c.first) % c.along_u;
    Hit hit;
    hit.distance = 0.0f;
    hit.primitive = static_cast<std::uint32_t>(next - 1 - cells_.begin());
    hit.u = (static_cast<float>(i) + 0.5f) / c.along_u;
    hit.v = (static_cast<float>(j) + 0.5f) / c.along_v;
    if (c.along_u == 1 && c.along_v == 1) hit.u = hit.v = 1.0f / 3.0f;
    // Cells on the long edge reach over it; their part of the triangle is what counts.
    if (const float sum = hit.u + hit.v; sum > 0.999f) {
        hit.u *= 0.999f / sum;
        hit.v *= 0.999f / sum;
    }
    hit.back_side = patch & 1u;
    return hit;
}

} // namespace afterglow
