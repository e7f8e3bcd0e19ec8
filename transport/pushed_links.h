#pragma once

#include "transport/packed_links.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#ifdef __F16C__
#include <immintrin.h>
#endif

namespace afterglow {

/// A link in a row that is read soon and then forgotten, of which there are many at a time. x, y and z are half
/// floats of 2^13 times the value: sizes below 8, rounded to 2^-11 of themselves or to 2^-38.
struct PushedLink {
    std::array<std::uint16_t, 3> half;
    std::uint16_t step; // sender less the one before it in the row, which is 0 at the start
};

/// Writes such rows.
class PushedLinkPacker {
public:
    /// Senders must rise within a row. Where they are too far apart, links that are zero lie between.
    void append(std::uint32_t sender, const LinkVector& value, std::vector<PushedLink>& row) {
        if (row.empty()) last_ = 0;
        std::uint32_t step = sender - last_;
        for (; step > longest_step; step -= longest_step) row.push_back({{}, longest_step});
        PushedLink& link = row.emplace_back();
        for (int c = 0; c < 3; ++c) link.half[static_cast<std::size_t>(c)] = Eigen::half(scale * value[c]).x;
        link.step = static_cast<std::uint16_t>(step);
        last_ = sender;
    }

    static LinkVector value_of(const PushedLink& link) {
#ifdef __F16C__
        const __m128 all = _mm_cvtph_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(&link)));
        constexpr int last_lane_zero = 8;
        LinkVector value;
        _mm_store_ps(value.data(), _mm_mul_ps(_mm_insert_ps(all, all, last_lane_zero), _mm_set1_ps(1.0f / scale)));
        return value;
#else
        const auto component = [&](std::size_t c) {
            return Eigen::half_impl::half_to_float(Eigen::half_impl::raw_uint16_to_half(link.half[c])) / scale;
        };
        return {component(0), component(1), component(2), 0.0f};
#endif
    }

private:
    static constexpr float scale = 8192.0f;
    static constexpr std::uint16_t longest_step = 0xffff;
    std::uint32_t last_ = 0;
};

/// Calls visit(sender, LinkVector) for the links of a row, senders rising.
template <class Visit>
void for_each_pushed(std::span<const PushedLink> row, const Visit& visit) {
    std::uint32_t sender = 0;
    for (const PushedLink& link : row) {
        sender += link.step;
        visit(sender, PushedLinkPacker::value_of(link));
    }
}

} // namespace afterglow
