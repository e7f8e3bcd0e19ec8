#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace afterglow {

/// A dense vector with a bit a place that says whether it was written, so that it is read in order
/// and cleared at the cost of what is in it.
template <class Value>
class Accumulator {
public:
    Accumulator(std::size_t size, const Value& zero)
        : zero_(zero), value_(size, zero), written_((size + bits - 1) / bits, 0) {}

    Value& at(std::uint32_t i) {
        written_[i / bits] |= std::uint64_t{1} << (i % bits);
        return value_[i];
    }
    /// Calls visit(i, value) for the written places in [begin, end), increasing; visit may write
    /// outside that range.
    template <class Visit>
    void for_each(std::uint32_t begin, std::uint32_t end, const Visit& visit) const {
        for (std::uint32_t w = begin / bits; w * bits < end; ++w) {
            std::uint64_t left = written_[w];
            if (w * bits < begin) left &= ~std::uint64_t{0} << (begin % bits);
            if (end - w * bits < bits) left &= ~(~std::uint64_t{0} << (end % bits));
            for (; left != 0; left &= left - 1) {
                const std::uint32_t i = w * bits + static_cast<std::uint32_t>(std::countr_zero(left));
                visit(i, value_[i]);
            }
        }
    }
    void clear() {
        for (std::uint32_t w = 0; w < written_.size(); ++w) {
            for (std::uint64_t left = written_[w]; left != 0; left &= left - 1)
                value_[w * bits + static_cast<std::uint32_t>(std::countr_zero(left))] = zero_;
            written_[w] = 0;
        }
    }

private:
    static constexpr std::uint32_t bits = 64;
    Value zero_;
    std::vector<Value> value_;
    std::vector<std::uint64_t> written_;
};

} // namespace afterglow
