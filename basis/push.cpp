#include "basis/push.h"

#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <type_traits>

namespace afterglow {
namespace {

constexpr int most_channels = 12;

/// sum_k weight_k values_k over a row.
inline std::array<float, most_channels> weighted_sum(const SparseRows<float>& rows, Index i, int channels,
                                                     std::span<const float> values) {
    std::array<float, most_channels> sum{};
    const auto index = rows.indices(i);
    const auto weight = rows.values(i);
    for (std::size_t e = 0; e < index.size(); ++e) {
        const float* from = &values[static_cast<std::size_t>(index[e]) * channels];
        for (int c = 0; c < channels; ++c) sum[c] += weight[e] * from[c];
    }
    return sum;
}

/// values_i += sign * sum_k weight_ik values_k for the points of one level. `fixed`: the number of
/// channels where it is known when this is compiled, which makes it twice as fast; else 0.
template <int fixed>
void add_weighted(const SparseRows<float>& rows, Index begin, Index end, int any_channels, float sign,
                  std::span<float> values) {
    const int channels = fixed > 0 ? fixed : any_channels;
    parallel_for(
        end - begin,
        [&](Index k) {
            const Index i = begin + k;
            const auto sum = weighted_sum(rows, i, channels, values);
            float* to = &values[static_cast<std::size_t>(i) * channels];
            for (int c = 0; c < channels; ++c) to[c] += sign * sum[c];
        },
        1024);
}

/// Calls visit with the number of channels where it is one that is often used, else with 0, as a type.
template <class Visit>
void with_fixed(int channels, const Visit& visit) {
    switch (channels) {
    case 3: return visit(std::integral_constant<int, 3>{});
    case 4: return visit(std::integral_constant<int, 4>{});
    case 9: return visit(std::integral_constant<int, 9>{});
    case 12: return visit(std::integral_constant<int, 12>{});
    default: return visit(std::integral_constant<int, 0>{});
    }
}

void add_weighted(const SparseRows<float>& rows, Index begin, Index end, int channels, float sign,
                  std::span<float> values) {
    with_fixed(channels, [&](auto fixed) {
        add_weighted<fixed()>(rows, begin, end, channels, sign, values);
    });
}

/// values_i = sum_k weight_ik values_k for the points of one level whose rows are not empty.
template <int fixed>
void average(const SparseRows<float>& rows, Index begin, Index end, int any_channels, std::span<float> values) {
    const int channels = fixed > 0 ? fixed : any_channels;
    parallel_for(
        end - begin,
        [&](Index k) {
            const Index i = begin + k;
            if (rows.indices(i).empty()) return;
            const auto sum = weighted_sum(rows, i, channels, values);
            std::copy_n(sum.begin(), channels, &values[static_cast<std::size_t>(i) * channels]);
        },
        256);
}

} // namespace

void PushOperator::push(const PointHierarchy& points, int levels, int channels,
                        std::span<float> values) const {
    for (int l = 1; l < levels; ++l)
        add_weighted(parents, points.begin(l), points.end(l), channels, 1.0f, values);
}

void PushOperator::difference(const PointHierarchy& points, int levels, int channels,
                              std::span<float> values) const {
    for (int l = levels - 1; l > 0; --l)
        add_weighted(parents, points.begin(l), points.end(l), channels, -1.0f, values);
}

PushOperator make_push_operator(const ShepardBasis& basis) {
    const PointHierarchy& points = basis.points();
    std::vector<std::vector<BasisEntry>> rows(points.size());
    for (int l = 1; l < points.levels(); ++l)
        parallel_for(points.end(l) - points.begin(l), [&](Index k) {
            const Index i = points.begin(l) + k;
            const int parent = points.parent_level[l];
            // No point of a level without openness lies where little can be seen.
            if (l >= points.openness_level && parent < points.openness_level
                && is_enclosed(points.normal.col(i), points.openness_of(i)))
                return;
            basis.evaluate_or_nearest(parent, points.point(i), rows[i]);
            drop_small_shares(rows[i]);
        });
    return {join_rows(std::move(rows))};
}

void PullOperator::pull(const PointHierarchy& points, int levels, int channels,
                        std::span<float> values) const {
    for (int l = levels - 2; l >= 0; --l)
        with_fixed(channels, [&](auto fixed) {
            average<fixed()>(children, points.begin(l), points.end(l), channels, values);
        });
}

void PullOperator::update(const PointHierarchy& points, int levels, int channels,
                          std::span<float> coefficients) const {
    for (int l = levels - 2; l >= 0; --l)
        add_weighted(children, points.begin(l), points.end(l), channels, 1.0f, coefficients);
}

} // namespace afterglow
