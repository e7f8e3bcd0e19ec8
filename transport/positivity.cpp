#include "transport/positivity.h"

#include "core/parallel.h"

#include <algorithm>
#include <atomic>
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
    is_asked_.resize(parents);
    share_.assign(parents, Rgb::Zero());
    changes_.resize(points.size() - first_point_);
}

void PositivityLimiter::operator()(std::span<const std::uint32_t> negative, VectorIrradiance& field) {
    DisplayPoints display{points_, field};
    const auto set = [](std::uint8_t& flag) { std::atomic_ref(flag).store(1, std::memory_order_relaxed); };
    parallel_for(static_cast<Index>(negative.size()), [&](Index k) {
        const std::uint32_t j = negative[static_cast<std::size_t>(k)];
        set(changes_[j - first_point_]); // of those without parents, too
        for (const std::uint32_t parent : push_.parents.indices(j)) set(is_asked_[parent - first_parent_]);
    }, 1024);
    // What is missing below each parent, and what there is to take it from.
    const auto parents = static_cast<Index>(is_asked_.size());
    parallel_for(parents, [&](Index k) {
        const auto parent = static_cast<std::size_t>(k);
        if (!is_asked_[parent]) return;
        Rgb missing = Rgb::Zero(), there = Rgb::Zero();
        for (std::uint32_t e = child_begin_[parent]; e < child_begin_[parent + 1]; ++e) {
            set(changes_[child_[e].point - first_point_]);
            const Rgb irradiance = display.irradiance(child_[e].point);
            missing += child_[e].weight * (-irradiance).max(0.0f);
            there += child_[e].weight * irradiance.max(0.0f);
        }
        share_[parent] = (there > 0.0f).select(missing / there.max(1e-30f), Rgb::Zero());
    }, 256);
    parallel_for(static_cast<Index>(changes_.size()), [&](Index k) {
        if (!changes_[static_cast<std::size_t>(k)]) return;
        changes_[static_cast<std::size_t>(k)] = 0;
        const Index j = first_point_ + k;
        const auto index = push_.parents.indices(j);
        const auto weight = push_.parents.values(j);
        Rgb taken = Rgb::Zero();
        for (std::size_t e = 0; e < index.size(); ++e) taken += weight[e] * share_[index[e] - first_parent_];
        const Rgb e = display.irradiance(j);
        display.add(j, e.max(0.0f) * (1.0f - taken.min(1.0f)) - e);
        // Rounding may leave a hair below zero.
        if (const Rgb rest = display.irradiance(j); (rest < 0.0f).any()) display.add(j, -2.0f * rest.min(0.0f));
    }, 1024);
    parallel_for(parents, [&](Index k) {
        if (!is_asked_[static_cast<std::size_t>(k)]) return;
        is_asked_[static_cast<std::size_t>(k)] = 0;
        share_[static_cast<std::size_t>(k)] = Rgb::Zero();
    }, 4096);
}

} // namespace afterglow
