#include "transport/link_columns.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

LinkColumns::LinkColumns(const Links& links, Index senders, Index first_row, Index last_row)
    : receivers_(last_row - first_row), senders_(senders),
      begin_(static_cast<std::size_t>(blocks() * (senders + 1))),
      count_(static_cast<std::size_t>(senders)) {
    const auto for_each_of_block = [&](Index block, const auto& visit) {
        const Index first = block * block_size;
        for (Index i = first; i < std::min(receivers_, first + block_size); ++i)
            links.for_each_packed(first_row + i, [&](std::uint32_t sender, std::uint32_t bits) {
                visit(sender, ColumnLink::pack(i - first, bits));
            });
    };
    // How many of each sender, then where they begin, then the entries themselves.
    const auto per_block = static_cast<std::size_t>(senders + 1);
    parallel_for(blocks(), [&](Index block) {
        std::uint64_t* count = &begin_[static_cast<std::size_t>(block) * per_block];
        for_each_of_block(block, [&](std::uint32_t sender, ColumnLink) { ++count[sender]; });
    }, 1);
    std::uint64_t total = 0;
    for (std::size_t k = 0; k < begin_.size(); ++k) {
        const std::uint64_t here = begin_[k];
        if (k % per_block < per_block - 1) count_[k % per_block] += static_cast<std::uint32_t>(here);
        begin_[k] = total;
        total += here;
    }
    entry_.resize(total);
    parallel_for(blocks(), [&](Index block) {
        const auto first = begin_.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(block) * per_block);
        std::vector<std::uint64_t> next(first, first + static_cast<std::ptrdiff_t>(per_block));
        for_each_of_block(block, [&](std::uint32_t sender, ColumnLink entry) {
            entry_[next[sender]++] = entry;
        });
    }, 1);
}

void LinkColumns::add_product(Index block, std::span<const Change> changes, std::span<Eigen::Vector4f> to) const {
    float* const first = to[static_cast<std::size_t>(3 * block * block_size)].data();
    const std::uint64_t* const begin = begin_.data() + static_cast<std::size_t>(block * (senders_ + 1));
    // Columns lie apart: what comes soon is fetched, first where its links are, then these.
    constexpr std::size_t far = 24, near = 12;
    for (std::size_t k = 0; k < changes.size(); ++k) {
        if (k + far < changes.size()) __builtin_prefetch(begin + changes[k + far].sender);
        if (k + near < changes.size()) {
            const ColumnLink* const links = entry_.data() + begin[changes[k + near].sender];
            __builtin_prefetch(links);
            __builtin_prefetch(links + 16);
        }
        add_column(segment(block, changes[k].sender), changes[k].coefficients.data(), first);
    }
}

std::vector<float> LinkColumns::norms(std::span<const float> weights) const {
    std::vector<float> norms(static_cast<std::size_t>(senders_));
    parallel_for(senders_, [&](Index sender) {
        double sum = 0.0;
        for (Index block = 0; block < blocks(); ++block)
            for (const ColumnLink& link : segment(block, sender))
                sum += static_cast<double>(weights[static_cast<std::size_t>(block * block_size + link.receiver())])
                       * link.vector().squaredNorm();
        norms[static_cast<std::size_t>(sender)] = static_cast<float>(std::sqrt(sum));
    });
    return norms;
}

} // namespace afterglow
