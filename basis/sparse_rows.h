#pragma once

#include "core/types.h"

#include <cstdint>
#include <span>
#include <vector>

namespace afterglow {

/// Compressed rows: row i holds index[begin[i] .. begin[i + 1]) with the values beside them.
template <class Value>
struct SparseRows {
    std::vector<std::uint64_t> begin{0};
    std::vector<std::uint32_t> index;
    std::vector<Value> value;

    Index rows() const { return static_cast<Index>(begin.size()) - 1; }
    std::uint64_t entries() const { return index.size(); }
    std::span<const std::uint32_t> indices(Index row) const {
        return {index.data() + begin[row], index.data() + begin[row + 1]};
    }
    std::span<const Value> values(Index row) const {
        return {value.data() + begin[row], value.data() + begin[row + 1]};
    }
};

/// One row under construction: index and value side by side.
template <class Value>
struct SparseEntry {
    std::uint32_t index;
    Value value;
};

/// Joins rows that were made one by one, in any order of time.
template <class Value>
SparseRows<Value> join_rows(const std::vector<std::vector<SparseEntry<Value>>>& rows) {
    SparseRows<Value> joined;
    joined.begin.reserve(rows.size() + 1);
    std::uint64_t total = 0;
    for (const auto& row : rows) joined.begin.push_back(total += row.size());
    joined.index.reserve(total);
    joined.value.reserve(total);
    for (const auto& row : rows)
        for (const auto& entry : row) {
            joined.index.push_back(entry.index);
            joined.value.push_back(entry.value);
        }
    return joined;
}

} // namespace afterglow
