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
    const int last = points.levels() - 1;
    const Index first = points.begin(last), count = points.end(last) - first;
    DisplayPoints display{points, field};
    std::vector<std::uint8_t> is_negative(static_cast<std::size_t>(count));
    parallel_for(count, [&](Index k) {
        is_negative[static_cast<std::size_t>(k)] = (display.irradiance(first + k) < 0.0f).any();
    }, 4096);
    make_positive(points, push, is_negative, field);
}

void make_positive(const PointHierarchy& points, const PushOperator& push, std::span<const std::uint8_t> is_negative,
                   VectorIrradiance& field) {
    if (std::find(is_negative.begin(), is_negative.end(), 1) == is_negative.end()) return;
    const int last = points.levels() - 1;
    const Index first = points.begin(last), count = points.end(last) - first;
    DisplayPoints display{points, field};

    // What is missing below each parent, and what there is to take it from.
    const Index parents = first;
    std::vector<Rgb> missing(static_cast<std::size_t>(parents), Rgb::Zero());
    std::vector<std::uint8_t> wants(static_cast<std::size_t>(parents));
    for (Index k = 0; k < count; ++k) {
        if (!is_negative[static_cast<std::size_t>(k)]) continue;
        const Rgb below = (-display.irradiance(first + k)).max(0.0f);
        const auto index = push.parents.indices(first + k);
        const auto weight = push.parents.values(first + k);
        for (std::size_t e = 0; e < index.size(); ++e) {
            missing[index[e]] += weight[e] * below;
            wants[index[e]] = 1;
        }
    }
    // Whose irradiance changes: found in parallel, added up in order.
    std::vector<std::uint8_t> changes(is_negative.begin(), is_negative.end());
    parallel_for(count, [&](Index k) {
        const auto index = push.parents.indices(first + k);
        changes[static_cast<std::size_t>(k)] |= std::any_of(
            index.begin(), index.end(), [&](std::uint32_t parent) { return wants[parent] != 0; });
    }, 4096);
    std::vector<Rgb> there(static_cast<std::size_t>(parents), Rgb::Zero());
    std::vector<Index> list;
    for (Index k = 0; k < count; ++k) {
        if (!changes[static_cast<std::size_t>(k)]) continue;
        const Index j = first + k;
        list.push_back(j);
        const Rgb above = display.irradiance(j).max(0.0f);
        const auto index = push.parents.indices(j);
        const auto weight = push.parents.values(j);
        for (std::size_t e = 0; e < index.size(); ++e) there[index[e]] += weight[e] * above;
    }
    // What each parent's points lose of their irradiance, as a share.
    parallel_for(parents, [&](Index k) {
        Rgb& share = missing[static_cast<std::size_t>(k)];
        const Rgb& above = there[static_cast<std::size_t>(k)];
        if (wants[static_cast<std::size_t>(k)])
            share = (above > 0.0f).select(share / above.max(1e-30f), Rgb::Zero());
    }, 4096);
    parallel_for(static_cast<Index>(list.size()), [&](Index k) {
        const Index j = list[static_cast<std::size_t>(k)];
        const auto index = push.parents.indices(j);
        const auto weight = push.parents.values(j);
        Rgb taken = Rgb::Zero();
        for (std::size_t e = 0; e < index.size(); ++e) taken += weight[e] * missing[index[e]];
        const Rgb e = display.irradiance(j);
        display.add(j, e.max(0.0f) * (1.0f - taken.min(1.0f)) - e);
        // Rounding may leave a hair below zero.
        if (const Rgb rest = display.irradiance(j); (rest < 0.0f).any()) display.add(j, -2.0f * rest.min(0.0f));
    }, 1024);
}

} // namespace afterglow
