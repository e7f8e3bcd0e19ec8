#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace afterglow {

/// A dense vector that knows in which blocks of sixteen places it was written, so that it is read in
/// order and cleared at the cost of what is in it.
template <class Value>
class Accumulator {
public:
    Accumulator(std::size_t size, const Value& zero)
        : zero_(zero), value_((size + block - 1) / block * block, zero), used_(value_.size() / block, 0) {}

    Value& at(std::uint32_t i) {
        used_[i / block] = 1;
        return value_[i];
    }
    /// Calls visit(i, value) for the written places in [begin, end), increasing (and for places of
    /// the same blocks that still hold zero); visit may write outside that range.
    template <class Visit>
    void for_each(std::uint32_t begin, std::uint32_t end, const Visit& visit) const {
        for (std::uint32_t b = begin / block; b * block < end; ++b) {
            if (!used_[b]) continue;
            const std::uint32_t last = std::min(end, (b + 1) * block);
            for (std::uint32_t i = std::max(begin, b * block); i < last; ++i) visit(i, value_[i]);
        }
    }
    void clear() {
        for (std::size_t b = 0; b < used_.size(); ++b) {
            if (!used_[b]) continue;
            std::fill_n(value_.begin() + static_cast<std::ptrdiff_t>(b * block), block, zero_);
            used_[b] = 0;
        }
    }

private:
    static constexpr std::uint32_t block = 16;
    Value zero_;
    std::vector<Value> value_;
    std::vector<std::uint8_t> used_;
};

} // namespace afterglow
