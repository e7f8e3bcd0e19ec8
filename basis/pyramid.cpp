#include "basis/pyramid.h"

#include "core/parallel.h"

namespace afterglow {

void Pyramid::analyse(const PointHierarchy& points, int levels, int channels,
                      std::span<float> values) const {
    const auto at = [&](std::uint32_t i) { return values.data() + std::size_t{i} * channels; };
    for (int l = 1; l < levels; ++l)
        parallel_for(
            points.end(l) - points.begin(l),
            [&](Index k) {
                const std::uint32_t i = points.begin(l) + static_cast<std::uint32_t>(k);
                const auto index = coarser.indices(i);
                const auto weight = coarser.values(i);
                for (std::size_t e = 0; e < index.size(); ++e)
                    for (int c = 0; c < channels; ++c)
                        at(i)[c] -= weight[e] * at(index[e])[c];
            },
            256);
}

Pyramid make_pyramid(const ShepardBasis& basis, int levels) {
    const PointHierarchy& points = basis.points();
    std::vector<std::vector<BasisEntry>> rows(points.end(levels - 1));
    for (int l = 1; l < levels; ++l)
        parallel_for(points.end(l) - points.begin(l), [&](Index k) {
            const Index i = points.begin(l) + k;
            for (int above = 0; above < l; ++above)
                basis.evaluate(above, points.point(i), rows[i]);
        });
    return {join_rows(std::move(rows))};
}

PullOperator make_point_pull(const ShepardBasis& basis, int levels) {
    const PointHierarchy& points = basis.points();
    std::vector<std::vector<BasisEntry>> rows(points.begin(levels - 1));
    std::vector<BasisEntry> parents;
    for (int l = 0; l + 1 < levels; ++l) {
        for (std::uint32_t child = points.begin(l + 1); child < points.end(l + 1); ++child) {
            parents.clear();
            basis.evaluate(l, points.point(child), parents);
            for (const BasisEntry& parent : parents)
                rows[parent.index].push_back({child, parent.value});
        }
        for (std::uint32_t k = points.begin(l); k < points.end(l); ++k)
            make_sum_one(rows[k]);
    }
    return {join_rows(std::move(rows))};
}

} // namespace afterglow
