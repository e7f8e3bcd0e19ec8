#include "tests/support/gather_oracle.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

MeanAndError over_repetitions(const Eigen::ArrayXXd& values) {
    const double n = static_cast<double>(values.cols());
    MeanAndError result{values.rowwise().mean(), {}};
    result.error =
        ((values.colwise() - result.mean).square().rowwise().sum() / (n * (n - 1.0))).sqrt();
    return result;
}

void weigh_by_reflectance(const PointHierarchy& points, const Rgb& reflectance,
                          std::vector<BasisEntry>& row) {
    double sum = 0.0;
    std::vector<double> weight;
    for (const BasisEntry& entry : row) {
        double difference2 = 0.0;
        for (int c = 0; c < 3; ++c)
            difference2 += std::pow(points.reflectance(c, entry.index) - reflectance[c], 2) / 3.0;
        weight.push_back(entry.value * (0.001 + std::exp(-difference2 / 0.01)));
        sum += weight.back();
    }
    for (std::size_t k = 0; k < row.size(); ++k)
        row[k].value = static_cast<float>(weight[k] / sum);
}

std::vector<BasisEntry> seen_field(const ShepardBasis& basis, const Footprint& footprint,
                                   const SurfacePoint& y, const Rgb& reflectance, double distance,
                                   double cosine) {
    const double size = footprint.angle * distance / std::max(cosine, 0.3);
    const double level =
        std::clamp(std::log2(footprint.coarsest_spacing / size), 0.0, footprint.levels - 1.0);
    std::vector<BasisEntry> field, row;
    for (int l = 0; l < footprint.levels; ++l) {
        const double weight = std::max(0.0, 1.0 - std::abs(level - l));
        if (weight == 0.0) continue;
        row.clear();
        for (int k = l; k >= 0 && row.empty(); --k)
            basis.evaluate(k, y, row);
        if (row.empty()) basis.evaluate_or_nearest(l, y, row);
        if (l + 1 == footprint.levels) weigh_by_reflectance(basis.points(), reflectance, row);
        drop_small_shares(row);
        for (const BasisEntry& entry : row)
            field.push_back({entry.index, static_cast<float>(weight) * entry.value});
    }
    return field;
}

MeanAndError irradiance_by_plain_gather(const Surface& surface, const ShepardBasis& basis,
                                        const Footprint& footprint, const SurfacePoint& receiver,
                                        const Eigen::MatrixXd& functionals, int rays,
                                        std::uint64_t seed) {
    const Frame frame(receiver.normal);
    constexpr Index chunk = 256;
    const Index chunks = (rays + chunk - 1) / chunk;
    std::vector<Eigen::ArrayXd> sum(static_cast<std::size_t>(chunks)), squares = sum;
    parallel_for(
        chunks,
        [&](Index c) {
            Eigen::ArrayXd& s = sum[c] = Eigen::ArrayXd::Zero(functionals.cols());
            Eigen::ArrayXd& q = squares[c] = s;
            Rng rng(seed, static_cast<std::uint64_t>(c));
            for (Index k = 0; k < chunk; ++k) {
                const float u = rng.uniform(), v = rng.uniform();
                const Vec3 direction = frame.to_world(sample_cosine({u, v}));
                const Hit hit = surface.closest_hit({surface.lifted(receiver), direction});
                if (!hit) continue;
                // Cosine and density cancel: the estimate is the field that is seen.
                const double cosine = std::abs(surface.geometric_normal(hit).dot(direction));
                Eigen::ArrayXd seen = Eigen::ArrayXd::Zero(functionals.cols());
                for (const BasisEntry& entry :
                     seen_field(basis, footprint, surface.point(hit), surface.reflectance(hit),
                                hit.distance, cosine))
                    seen += entry.value * functionals.row(entry.index).transpose().array();
                s += seen;
                q += seen.square();
            }
        },
        1);
    const double n = static_cast<double>(chunks * chunk);
    Eigen::ArrayXd total = Eigen::ArrayXd::Zero(functionals.cols()), total_squares = total;
    for (Index c = 0; c < chunks; ++c) {
        total += sum[c];
        total_squares += squares[c];
    }
    const Eigen::ArrayXd mean = total / n;
    return {mean, ((total_squares / n - mean.square()).max(0.0) / n).sqrt()};
}

} // namespace afterglow
