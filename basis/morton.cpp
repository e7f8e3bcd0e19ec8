#include "basis/morton.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <numeric>

namespace afterglow {
namespace {

/// Puts two zero bits between the 21 lowest bits of x.
std::uint64_t spread_bits(std::uint64_t x) {
    x &= 0x1fffff;
    x = (x | x << 32) & 0x001f00000000ffffULL;
    x = (x | x << 16) & 0x001f0000ff0000ffULL;
    x = (x | x << 8) & 0x100f00f00f00f00fULL;
    x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
    return (x | x << 2) & 0x1249249249249249ULL;
}

} // namespace

std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2;
}

std::vector<std::uint32_t> morton_order(std::span<const Vec3> positions) {
    Eigen::AlignedBox3f box;
    for (const Vec3& p : positions) box.extend(p);
    const float size = positions.empty() ? 1.0f : std::max(box.sizes().maxCoeff(), 1e-30f);
    std::vector<std::uint64_t> code(positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i) {
        const Vec3 u = (positions[i] - box.min()) / size;
        const Eigen::Array<std::uint32_t, 3, 1> cell = (u.array() * 2097151.0f).cast<std::uint32_t>();
        code[i] = morton_code(cell[0], cell[1], cell[2]);
    }
    std::vector<std::uint32_t> order(positions.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return code[a] != code[b] ? code[a] < code[b] : a < b;
    });
    return order;
}

} // namespace afterglow
