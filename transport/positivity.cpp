#include "transport/positivity.h"

#include "core/parallel.h"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace afterglow {
namespace {

struct DisplayPoints {
    const PointHierarchy& points;
    VectorIrradiance& field;

    Rgb irradiance(Index j) const { return net_irradiance(field, j, points.normal.col(j)); }
    void add(Index j, const Rgb& change) {
        for (int a = 0; a < 3; ++a)
            for (int c = 0; c < 3; ++c)
                field[static_cast<std::size_t>(9 * j + 3 * a + c)] += points.normal(a, j) * change[c];
    }
};

} // namespace

void make_positive(const PointHierarchy& points, const PushOperator& push, VectorIrradiance& field) {
    const std::uint32_t first = points.begin(points.levels() - 1);
    const Index count = points.size() - first;
    DisplayPoints display{points, field};
    std::vector<std::uint8_t> is_negative(static_cast<std::size_t>(count));
    parallel_for(count, [&](Index k) {
        is_negative[static_cast<std::size_t>(k)] = (display.irradiance(first + k) < 0.0f).any();
    }, 4096);
    std::vector<std::uint32_t> negative;
    for (std::uint32_t k = 0; k < count; ++k)
        if (is_negative[k]) negative.push_back(first + k);
    if (!negative.empty()) PositivityLimiter(points, push)(negative, field);
}

PositivityLimiter::PositivityLimiter(const PointHierarchy& points, const PushOperator& push)
    : points_(points), push_(push), first_parent_(0), first_point_(points.begin(points.levels() - 1)) {
    const int parents_level = points.parent_level.back();
    std::uint32_t parents = 0;
    if (parents_level >= 0) {
        first_parent_ = points.begin(parents_level);
        parents = points.end(parents_level) - first_parent_;
    }
    // How many each parent has, then where they begin, then the children themselves, rising.
    child_begin_.resize(parents + 1);
    for (std::uint32_t j = first_point_; j < points.size(); ++j)
        for (const std::uint32_t parent : push.parents.indices(j)) ++child_begin_[parent - first_parent_ + 1];
    for (std::uint32_t k = 0; k < parents; ++k) child_begin_[k + 1] += child_begin_[k];
    child_.resize(child_begin_.back());
    std::vector<std::uint32_t> next(child_begin_.begin(), child_begin_.end() - 1);
    for (std::uint32_t j = first_point_; j < points.size(); ++j) {
        const auto index = push.parents.indices(j);
        const auto weight = push.parents.values(j);
        for (std::size_t e = 0; e < index.size(); ++e) child_[next[index[e] - first_parent_]++] = {j, weight[e]};
    }
    slot_.assign(parents, none);
    changes_.resize(points.size() - first_point_);
}

void PositivityLimiter::operator()(std::span<const std::uint32_t> negative, VectorIrradiance& field) {
    DisplayPoints display{points_, field};
    taken_.clear();
    changed_.assign(negative.begin(), negative.end());
    for (const std::uint32_t j : negative) {
        changes_[j - first_point_] = 1;
        for (const std::uint32_t parent : push_.parents.indices(j))
            if (std::uint32_t& slot = slot_[parent - first_parent_]; slot == none) {
                slot = static_cast<std::uint32_t>(taken_.size());
                taken_.push_back({parent - first_parent_, Rgb::Zero()});
            }
    }
    for (const Parent& parent : taken_)
        for (std::uint32_t e = child_begin_[parent.id]; e < child_begin_[parent.id + 1]; ++e)
            if (std::uint8_t& changes = changes_[child_[e].point - first_point_]; !changes) {
                changes = 1;
                changed_.push_back(child_[e].point);
            }
    // What is missing below each parent, and what there is to take it from.
    parallel_for(static_cast<Index>(taken_.size()), [&](Index k) {
        Parent& parent = taken_[static_cast<std::size_t>(k)];
        Rgb missing = Rgb::Zero(), there = Rgb::Zero();
        for (std::uint32_t e = child_begin_[parent.id]; e < child_begin_[parent.id + 1]; ++e) {
            const Rgb irradiance = display.irradiance(child_[e].point);
            missing += child_[e].weight * (-irradiance).max(0.0f);
            there += child_[e].weight * irradiance.max(0.0f);
        }
        parent.share = (there > 0.0f).select(missing / there.max(1e-30f), Rgb::Zero());
    }, 64);
    parallel_for(static_cast<Index>(changed_.size()), [&](Index k) {
        const std::uint32_t j = changed_[static_cast<std::size_t>(k)];
        const auto index = push_.parents.indices(j);
        const auto weight = push_.parents.values(j);
        Rgb taken = Rgb::Zero();
        for (std::size_t e = 0; e < index.size(); ++e)
            if (const std::uint32_t slot = slot_[index[e] - first_parent_]; slot != none)
                taken += weight[e] * taken_[slot].share;
        const Rgb e = display.irradiance(j);
        display.add(j, e.max(0.0f) * (1.0f - taken.min(1.0f)) - e);
        // Rounding may leave a hair below zero.
        if (const Rgb rest = display.irradiance(j); (rest < 0.0f).any()) display.add(j, -2.0f * rest.min(0.0f));
        changes_[j - first_point_] = 0;
    }, 512);
    for (const Parent& parent : taken_) slot_[parent.id] = none;
}

} // namespace afterglow
