#include "transport/measures.h"

#include "core/error.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace afterglow {

Measures measure(const Eigen::Array3Xf& x, const Eigen::Array3Xf& y) {
    if (x.cols() != y.cols())
        throw Error("cannot compare " + std::to_string(x.cols()) + " samples with "
                    + std::to_string(y.cols()));
    if (x.cols() == 0) throw Error("there are no samples to compare");
    if (!x.allFinite() || !y.allFinite()) throw Error("cannot compare: some values are not finite");

    Measures m;
    m.samples = x.cols();
    const auto difference = x.cast<double>() - y.cast<double>();
    m.reference_mean = y.cast<double>().mean();
    if (!(m.reference_mean > 0.0)) throw Error("cannot compare: the reference is black");
    m.rel_rmse = std::sqrt(difference.square().mean()) / m.reference_mean;
    m.rel_l1 = difference.abs().mean() / m.reference_mean;
    m.bias = difference.mean() / m.reference_mean;

    std::vector<double> relative(static_cast<std::size_t>(x.cols()));
    for (Eigen::Index k = 0; k < x.cols(); ++k)
        relative[static_cast<std::size_t>(k)] =
            difference.col(k).abs().mean()
            / (y.col(k).cast<double>().mean() + 0.01 * m.reference_mean);
    std::sort(relative.begin(), relative.end());
    const auto percentile = [&](double q) {
        const double rank = std::ceil(q * static_cast<double>(relative.size()));
        return relative[static_cast<std::size_t>(std::max(1.0, rank)) - 1];
    };
    m.median = percentile(0.5);
    m.p95 = percentile(0.95);
    m.p99 = percentile(0.99);
    return m;
}

} // namespace afterglow
