#pragma once

#include "core/types.h"
#include "transport/packed_links.h"

#include <array>
#include <cstdint>
#include <span>

namespace afterglow {

/// Products of links and coefficients: for x, y and z of the links, R, G, B and 0 each.
using LinkProduct = std::array<float, 12>;

/// n . V of a product: R, G, B, 0.
inline Eigen::Array4f net_irradiance(const float* product, const Vec3& n) {
    using Map = Eigen::Map<const Eigen::Array4f>;
    return n.x() * Map(product) + n.y() * Map(product + 4) + n.z() * Map(product + 8);
}

/// Sum of link times coefficient over a row. `coefficients`: four floats (R, G, B, 0) a sender.
LinkProduct multiply_row(const Links& links, Index row, const float* coefficients);

/// True where the senders of a row rise and are below `senders`.
bool is_sound_row(const Links& links, Index row, std::uint32_t senders);

/// A link of a column: the receiver within a block of 2^13, then from bit 13 on what bits 7 to 23 of a
/// PackedLink are: exponent, x, y and z.
struct ColumnLink {
    static constexpr Index block_size = 1 << 13;
    std::uint32_t bits;

    static ColumnLink pack(Index receiver, std::uint32_t packed) {
        return {static_cast<std::uint32_t>(receiver) | (packed >> 7) << 13};
    }
    std::uint32_t receiver() const { return bits & (block_size - 1); }
    LinkVector vector() const { return Links::vector_of((bits >> 13) << 7); }
};

/// Adds link times coefficient to the product of each link's receiver, twelve floats each; no receiver may
/// come twice. `coefficient`: R, G, B, 0.
void add_column(std::span<const ColumnLink> links, const float* coefficient, float* products);

} // namespace afterglow
