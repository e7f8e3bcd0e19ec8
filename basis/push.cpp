#include "basis/push.h"

#include "core/parallel.h"

#include <algorithm>
#include <array>

namespace afterglow {
namespace {

constexpr int most_channels = 9;

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
            std::array<float, most_channels> sum{};
            const auto index = rows.indices(i);
            const auto weight = rows.values(i);
            for (std::size_t e = 0; e < index.size(); ++e) {
                const float* from = &values[static_cast<std::size_t>(index[e]) * channels];
                for (int c = 0; c < channels; ++c) sum[c] += weight[e] * from[c];
            }
            float* to = &values[static_cast<std::size_t>(i) * channels];
            for (int c = 0; c < channels; ++c) to[c] += sign * sum[c];
        },
        1024);
}

void add_weighted(const SparseRows<float>& rows, Index begin, Index end, int channels, float sign,
                  std::span<float> values) {
    if (channels == 9)
        add_weighted<9>(rows, begin, end, channels, sign, values);
    else if (channels == 3)
        add_weighted<3>(rows, begin, end, channels, sign, values);
    else
        add_weighted<0>(rows, begin, end, channels, sign, values);
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
        parallel_for(
            points.end(l) - points.begin(l),
            [&](Index k) {
                const Index i = points.begin(l) + k;
                const auto index = children.indices(i);
                const auto weight = children.values(i);
                if (index.empty()) return;
                std::array<float, most_channels> sum{};
                for (std::size_t e = 0; e < index.size(); ++e) {
                    const float* from = &values[static_cast<std::size_t>(index[e]) * channels];
                    for (int c = 0; c < channels; ++c) sum[c] += weight[e] * from[c];
                }
                std::copy_n(sum.begin(), channels, &values[static_cast<std::size_t>(i) * channels]);
            },
            256);
}

void PullOperator::update(const PointHierarchy& points, int levels, int channels,
                          std::span<float> coefficients) const {
    for (int l = levels - 2; l >= 0; --l)
        add_weighted(children, points.begin(l), points.end(l), channels, 1.0f, coefficients);
}

} // namespace afterglow
