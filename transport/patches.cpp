#include "transport/patches.h"

#include "core/error.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

PatchGrid::PatchGrid(const Scene& scene, float size)
    : scene_(scene), cells_(scene.triangles.size()) {
    constexpr float most_along = 1024.0f;
    std::uint64_t cells = 0;
    for (std::size_t t = 0; t < cells_.size(); ++t) {
        const Triangle& corner = scene.triangles[t];
        const Vec3& a = scene.positions[corner[0]];
        const auto along = [&](const Vec3& b) {
            return static_cast<std::uint16_t>(
                std::clamp(std::ceil((b - a).norm() / size), 1.0f, most_along));
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
    const auto next =
        std::upper_bound(cells_.begin(), cells_.end(), cell,
                         [](std::uint32_t c, const Cells& cells) { return c < cells.first; });
    const Cells& c = *(next - 1);
    return {static_cast<std::uint32_t>(next - 1 - cells_.begin()), (cell - c.first) % c.along_u,
            (cell - c.first) / c.along_u};
}

PatchGrid::Part PatchGrid::part(const Location& at) const {
    // [u0, u1] x [v0, v1] below u + v = 1, where the triangle's third edge runs: the corner
    // triangle that begins at (u0, v0), less those at (u1, v0) and (u0, v1), plus the one taken
    // away twice.
    const Cells& c = cells_[at.triangle];
    Part part;
    for (int k = 0; k < 4; ++k) {
        const double u = static_cast<double>(at.i + (k & 1)) / c.along_u;
        const double v = static_cast<double>(at.j + (k >> 1)) / c.along_v;
        const double side = std::max(0.0, 1.0 - u - v);
        const double share = (k == 0 || k == 3 ? 1.0 : -1.0) * side * side;
        part.share += share;
        part.u += share * (u + side / 3.0);
        part.v += share * (v + side / 3.0);
    }
    if (part.share > 0.0) {
        part.u /= part.share;
        part.v /= part.share;
    }
    return part;
}

Hit PatchGrid::center(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Part part = this->part(at);
    Hit hit;
    hit.distance = 0.0f;
    hit.primitive = at.triangle;
    hit.u = std::clamp(static_cast<float>(part.u), 0.0f, 1.0f);
    hit.v = std::clamp(static_cast<float>(part.v), 0.0f, 1.0f - hit.u);
    hit.back_side = patch & 1u;
    return hit;
}

std::array<Hit, 4> PatchGrid::corners(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Cells& c = cells_[at.triangle];
    const Hit centre = center(patch);
    std::array<Hit, 4> corners;
    for (std::uint32_t k = 0; k < 4; ++k) {
        float u = static_cast<float>(at.i + (k & 1)) / static_cast<float>(c.along_u);
        float v = static_cast<float>(at.j + (k >> 1)) / static_cast<float>(c.along_v);
        const float beyond = std::max(1.0f, u + v); // the third edge
        u /= beyond;
        v /= beyond;
        corners[k] = centre;
        corners[k].u += 0.98f * (u - centre.u);
        corners[k].v += 0.98f * (v - centre.v);
    }
    return corners;
}

float PatchGrid::area(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Triangle& corner = scene_.triangles[at.triangle];
    const Vec3& a = scene_.positions[corner[0]];
    const float parallelogram =
        (scene_.positions[corner[1]] - a).cross(scene_.positions[corner[2]] - a).norm();
    return 0.5f * parallelogram * static_cast<float>(std::max(0.0, part(at).share));
}

} // namespace afterglow
