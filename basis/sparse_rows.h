#pragma once

#include "core/types.h"

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace afterglow {

/// An immutable array that shares its storage: a vector's or a mapped file's.
template <class T>
class SharedArray {
public:
    SharedArray() = default;
    explicit SharedArray(std::vector<T> values) {
        auto held = std::make_shared<const std::vector<T>>(std::move(values));
        view_ = *held;
        owner_ = std::move(held);
    }
    SharedArray(std::span<const T> view, std::shared_ptr<const void> owner)
        : view_(view), owner_(std::move(owner)) {}

    std::size_t size() const { return view_.size(); }
    const T& operator[](std::size_t i) const { return view_[i]; }
    const T* data() const { return view_.data(); }
    std::span<const T> span() const { return view_; }

private:
    std::span<const T> view_;
    std::shared_ptr<const void> owner_;
};

/// Compressed rows: row i holds index[begin[i] .. begin[i + 1]) with the values beside them.
template <class Value>
struct SparseRows {
    SharedArray<std::uint64_t> begin; // rows + 1
    SharedArray<std::uint32_t> index;
    SharedArray<Value> value;

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

/// Joins rows that were made one by one, in any order of time; the rows are freed on the way.
template <class Value>
SparseRows<Value> join_rows(std::vector<std::vector<SparseEntry<Value>>> rows) {
    std::vector<std::uint64_t> begin{0};
    begin.reserve(rows.size() + 1);
    for (const auto& row : rows) begin.push_back(begin.back() + row.size());
    std::vector<std::uint32_t> index;
    std::vector<Value> value;
    index.reserve(begin.back());
    value.reserve(begin.back());
    for (auto& row : rows) {
        for (const auto& entry : row) {
            index.push_back(entry.index);
            value.push_back(entry.value);
        }
        std::vector<SparseEntry<Value>>().swap(row);
    }
    return {SharedArray(std::move(begin)), SharedArray(std::move(index)), SharedArray(std::move(value))};
}

} // namespace afterglow
