#include "transport/flattening.h"

#include "core/parallel.h"

#include <algorithm>
#include <array>

namespace afterglow {

Flattening::Flattening(const PointHierarchy& points, const Surface& surface)
    : first_(points.begin(points.levels() - 1)) {
    const ShepardBasis basis(points, surface, false);
    std::vector<std::vector<BasisEntry>> rows(points.size() - first_);
    parallel_for(static_cast<Index>(rows.size()), [&](Index k) {
        for (int l = 0; l < points.levels(); ++l)
            basis.evaluate(l, points.point(first_ + k), rows[static_cast<std::size_t>(k)]);
    });
    rows_ = join_rows(std::move(rows));
}

void Flattening::apply(VectorIrradiance& field) const {
    std::vector<float> values(9 * static_cast<std::size_t>(rows_.rows()));
    parallel_for(rows_.rows(), [&](Index k) {
        std::array<float, 9> sum{};
        const auto index = rows_.indices(k);
        const auto weight = rows_.values(k);
        for (std::size_t e = 0; e < index.size(); ++e)
            for (int c = 0; c < 9; ++c)
                sum[c] += weight[e] * field[9 * static_cast<std::size_t>(index[e]) + static_cast<std::size_t>(c)];
        std::copy_n(sum.begin(), 9, &values[9 * static_cast<std::size_t>(k)]);
    });
    std::copy(values.begin(), values.end(), field.begin() + 9 * static_cast<std::ptrdiff_t>(first_));
}

} // namespace afterglow
