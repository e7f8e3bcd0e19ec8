#pragma once

#include "transport/link_products.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// The links sorted by sender: for products with vectors of which few entries are not zero. Receivers
/// come in blocks, whose results stay in a core's cache; within a block links are sorted by sender.
/// Four bytes a link, and eight a block and sender.
class LinkColumns {
public:
    static constexpr Index block_size = ColumnLink::block_size; // receivers

    /// Copies the links of the rows [first, last), which are its receivers, from so many senders.
    LinkColumns(const Links& links, Index senders, Index first, Index last);

    std::uint64_t links() const { return entry_.size(); }
    std::uint32_t links_of(Index sender) const { return count_[static_cast<std::size_t>(sender)]; }
    /// By how much the coefficients of a sender change.
    struct Change {
        std::uint32_t sender;
        Eigen::Vector4f coefficients; // R, G, B, 0
    };
    /// to[3 i + a] += sum of link_ij[a] * change_j over the changes j, for the block's receivers i (counted
    /// from the first of all) and axes a. Changes must rise by sender. Blocks may be added to at the same time.
    void add_product(Index block, std::span<const Change> changes, std::span<Eigen::Vector4f> to) const;
    Index blocks() const { return (receivers_ + block_size - 1) / block_size; }
    /// Square root of sum_i weight_i |link_ij|^2 of each sender; a weight a receiver.
    std::vector<float> norms(std::span<const float> weights) const;

private:
    Index receivers_, senders_;
    std::vector<std::uint64_t> begin_; // of block b and sender j: b * (senders + 1) + j
    std::vector<ColumnLink> entry_;
    std::vector<std::uint32_t> count_; // a sender
    std::span<const ColumnLink> segment(Index block, Index sender) const {
        const auto at = static_cast<std::size_t>(block * (senders_ + 1) + sender);
        return {entry_.data() + begin_[at], entry_.data() + begin_[at + 1]};
    }
};

} // namespace afterglow
