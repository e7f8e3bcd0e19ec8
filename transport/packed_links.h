#pragma once

#include "basis/sparse_rows.h"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace afterglow {

/// A link's x, y, z and a lane that is zero.
using LinkVector = Eigen::Vector4f;

/// Three bytes of a row of links: 24 bits, the lowest first.
///
///     0-6    step: sender less the sender before it in the row, which is -1 at the start
///     7-11   exponent E
///     12-23  x, y, z: four bits each, two's complement, -7 to 7
///
/// and the link is (x, y, z) 2^(E - 31). Where x, y and z are all zero the entry is a *jump*: bits
/// 0-11 are a step, and there is no link. Links are sums over few rays: rounding by at most a
/// fifteenth to two fifteenths of the largest component is lost in their noise.
using PackedLink = std::array<std::uint8_t, 3>;

/// Writes the rows of links.
class LinkPacker {
public:
    /// What a link is rounded to; zero where it is below 2^-32.
    static LinkVector rounded(const LinkVector& value) {
        const float step = step_of(exponent_of(value));
        return step * (value / step).array().round().min(float{most}).max(-float{most});
    }

    /// Appends a link, rounded, to a row; senders must rise within it. Returns the value as it will
    /// be read; nothing is appended where that is zero.
    LinkVector append(std::uint32_t sender, const LinkVector& value, std::vector<PackedLink>& row) {
        if (row.empty()) last_ = -1;
        const LinkVector stored = rounded(value);
        if (stored.isZero(0.0f)) return stored;

        std::int64_t distance = static_cast<std::int64_t>(sender) - last_;
        for (; distance > longest_step; distance -= std::min<std::int64_t>(distance - 1, longest_jump))
            push(static_cast<std::uint32_t>(std::min<std::int64_t>(distance - 1, longest_jump)), row);
        const std::uint32_t exponent = exponent_of(value);
        std::uint32_t bits = static_cast<std::uint32_t>(distance) | exponent << 7;
        for (int c = 0; c < 3; ++c) {
            const auto steps = static_cast<std::int32_t>(stored[c] / step_of(exponent));
            bits |= (static_cast<std::uint32_t>(steps) & 15u) << (12 + 4 * c);
        }
        push(bits, row);
        last_ = sender;
        return stored;
    }

    static float step_of(std::uint32_t exponent) {
        return std::bit_cast<float>((exponent + 127 - 31) << 23);
    }

private:
    static constexpr int most = 7;
    static constexpr std::int64_t longest_step = 127, longest_jump = 4095;

    /// The smallest step of which a link's largest component has no more than seven and a half.
    static std::uint32_t exponent_of(const LinkVector& value) {
        int exponent = 0;
        std::frexp(value.cwiseAbs().maxCoeff() / (most + 0.5f), &exponent);
        return static_cast<std::uint32_t>(std::clamp(exponent + 31, 0, 31));
    }

    static void push(std::uint32_t bits, std::vector<PackedLink>& row) {
        row.push_back({static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
                       static_cast<std::uint8_t>(bits >> 16)});
    }

    std::int64_t last_ = -1;
};

/// All links: a row a receiver.
struct Links {
    SharedArray<std::uint64_t> begin; // rows + 1: row i holds entry[begin[i] .. begin[i + 1])
    SharedArray<PackedLink> entry;

    Index rows() const { return static_cast<Index>(begin.size()) - 1; }
    std::uint64_t entries() const { return entry.size(); }
    std::span<const PackedLink> row(Index i) const {
        return {entry.data() + begin[i], entry.data() + begin[i + 1]};
    }

    /// Links of the rows [first, last): entries that are not jumps.
    std::uint64_t count(Index first, Index last) const {
        return static_cast<std::uint64_t>(std::count_if(
            entry.data() + begin[first], entry.data() + begin[last],
            [](const PackedLink& packed) { return !is_jump(bits_of(packed)); }));
    }

    /// Calls visit(sender, LinkVector) for the links of a row, senders rising.
    template <class Visit>
    void for_each(Index i, const Visit& visit) const {
        for_each_packed(i, [&](std::uint32_t sender, std::uint32_t bits) { visit(sender, vector_of(bits)); });
    }
    /// The same with the entry's bits.
    template <class Visit>
    void for_each_packed(Index i, const Visit& visit) const {
        std::uint32_t sender = ~0u;
        for (const PackedLink& packed : row(i)) {
            const std::uint32_t bits = bits_of(packed);
            sender += step_of(bits);
            if (!is_jump(bits)) visit(sender, bits);
        }
    }

    /// What the bits of an entry say: whether it is a jump, and how many senders further it leads.
    static bool is_jump(std::uint32_t bits) { return bits >> 12 == 0; }
    static std::uint32_t step_of(std::uint32_t bits) { return is_jump(bits) ? bits : bits & 127u; }
    /// The link of an entry that is not a jump.
    static LinkVector vector_of(std::uint32_t bits) {
        const float step = LinkPacker::step_of(bits >> 7 & 31u);
#ifdef __AVX2__
        // Each component's four bits to the top of its lane, then down again with their sign.
        const __m128i top = _mm_sllv_epi32(_mm_set1_epi32(static_cast<int>(bits)),
                                           _mm_setr_epi32(16, 12, 8, 0));
        const __m128 steps = _mm_cvtepi32_ps(_mm_srai_epi32(top, 28));
        LinkVector link;
        _mm_store_ps(link.data(), _mm_mul_ps(steps, _mm_set1_ps(step)));
        return link;
#else
        const auto component = [&](int c) {
            return static_cast<float>(static_cast<std::int32_t>(bits << (16 - 4 * c)) >> 28);
        };
        return step * LinkVector(component(0), component(1), component(2), 0.0f);
#endif
    }
    static std::uint32_t bits_of(const PackedLink& packed) {
        return packed[0] | static_cast<std::uint32_t>(packed[1]) << 8
               | static_cast<std::uint32_t>(packed[2]) << 16;
    }
};

} // namespace afterglow
