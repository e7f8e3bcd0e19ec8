#include "transport/patches.h"

#include "core/error.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

PatchGrid::PatchGrid(const Scene& scene, float size) : scene_(scene), cells_(scene.triangles.size()) {
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

PatchGrid::Location PatchGrid::locate(std::uint32_t patch) const {
    const std::uint32_t cell = patch / 2;
    const auto next = std::upper_bound(cells_.begin(), cells_.end(), cell,
                                       [](std::uint32_t c, const Cells& cells) { return c < cells.first; });
    const Cells& c = *(next - 1);
    return {static_cast<std::uint32_t>(next - 1 - cells_.begin()), (cell - c.first) % c.along_u,
            (cell - c.first) / c.along_u};
}

Hit PatchGrid::center(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Cells& c = cells_[at.triangle];
    Hit hit;
    hit.distance = 0.0f;
    hit.primitive = at.triangle;
    hit.u = (static_cast<float>(at.i) + 0.5f) / c.along_u;
    hit.v = (static_cast<float>(at.j) + 0.5f) / c.along_v;
    if (c.along_u == 1 && c.along_v == 1) hit.u = hit.v = 1.0f / 3.0f;
    // Cells on the long edge reach over it; their part of the triangle is what counts.
    if (const float sum = hit.u + hit.v; sum > 0.999f) {
        hit.u *= 0.999f / sum;
        hit.v *= 0.999f / sum;
    }
    hit.back_side = patch & 1u;
    return hit;
}

float PatchGrid::area(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Cells& c = cells_[at.triangle];
    const Triangle& corner = scene_.triangles[at.triangle];
    const Vec3& a = scene_.positions[corner[0]];
    const float parallelogram
        = (scene_.positions[corner[1]] - a).cross(scene_.positions[corner[2]] - a).norm();
    // The part of [0, du] x [0, dv] below the line x + y = rest, where the long edge runs.
    const float du = 1.0f / c.along_u, dv = 1.0f / c.along_v;
    const float rest = 1.0f - at.i * du - at.j * dv;
    const auto half_square = [](float x) { return x > 0.0f ? 0.5f * x * x : 0.0f; };
    const float inside = half_square(rest) - half_square(rest - du) - half_square(rest - dv)
                         + half_square(rest - du - dv);
    return parallelogram * std::max(0.0f, inside);
}

} // namespace afterglow
