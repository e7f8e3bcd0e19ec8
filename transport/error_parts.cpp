#include "transport/error_parts.h"

#include "basis/shepard_basis.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/display.h"
#include "transport/sender_rows.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <vector>

namespace afterglow {
namespace {

/// Irradiance [W/m^2] of a place, a column a light, by two halves of the rays: their mean, and the variance of
/// that mean.
struct Gathered {
    Eigen::Array3Xf mean, variance;
};

Gathered gather_anew(const Surface& surface, const ShepardBasis& basis, int sender_level,
                     const SurfacePoint& x, const std::vector<Radiosity>& radiosity, std::uint32_t rays_of_half,
                     std::uint64_t seed) {
    const auto lights = static_cast<Index>(radiosity.size());
    const Frame frame(x.normal);
    std::array<Eigen::Array3Xf, 2> half;
    std::vector<BasisEntry> row;
    for (std::uint64_t h = 0; h < 2; ++h) {
        Eigen::Array3Xf& sum = half[h] = Eigen::Array3Xf::Zero(3, lights);
        for (std::uint32_t k = 0; k < rays_of_half; ++k) {
            const Vec3 direction = frame.to_world(sample_cosine(scrambled_sobol2(k, hash64(seed, h))));
            const Hit hit = surface.closest_hit({surface.lifted(x), direction});
            if (!hit) continue;
            row.clear();
            sender_row(surface, basis, sender_level, hit, row);
            for (const BasisEntry& entry : row)
                for (Index l = 0; l < lights; ++l)
                    sum.col(l) += entry.value * Rgb::Map(&radiosity[static_cast<std::size_t>(l)][3 * entry.index]);
        }
        sum /= static_cast<float>(rays_of_half);
    }
    return {0.5f * (half[0] + half[1]), 0.25f * (half[0] - half[1]).square()};
}

/// Of mean squares of each place, which noise makes negative at some.
ErrorPart part_of(const Eigen::ArrayXd& square) {
    const auto count = static_cast<double>(square.size());
    const double mean = square.mean();
    if (!(mean > 0.0)) return {};
    const double error = std::sqrt((square - mean).square().sum() / (count * std::max(1.0, count - 1.0)));
    return {std::sqrt(mean), error / (2.0 * std::sqrt(mean))};
}

} // namespace

std::string ErrorParts::text() const {
    std::array<char, 160> line{};
    std::snprintf(line.data(), line.size(), "senders %.1f %% +- %.1f, links %.1f %% +- %.1f, between receivers %.1f %% +- %.1f",
                  100.0 * senders.rms, 100.0 * senders.standard_error, 100.0 * links.rms, 100.0 * links.standard_error,
                  100.0 * receivers.rms, 100.0 * receivers.standard_error);
    return line.data();
}

ErrorParts error_parts(const Surface& surface, const TransferOperator& transfer, const Trial& trial,
                       const IrradianceEstimate& reference, const ErrorPartsOptions& options) {
    assert(transfer.kind == OperatorKind::neumann && !trial.places.empty());
    const PointHierarchy& points = transfer.points;
    const int display_level = points.levels() - 1, sender_level = transfer.sender_levels - 1;
    const ShepardBasis basis(points, surface, true);
    const LightTransport transport(transfer, surface);
    const Display display(transfer, surface);
    const auto all_places = static_cast<Index>(trial.places.size());
    const auto lights = static_cast<Index>(trial.lights.size());
    const auto half = static_cast<std::uint32_t>(options.rays / 2);

    std::vector<Index> lit; // lights that show
    std::vector<double> mean;
    std::vector<Radiosity> radiosity;
    std::vector<VectorIrradiance> field;
    for (Index l = 0; l < lights; ++l) {
        const double m = reference.indirect(Eigen::all, Eigen::seqN(l, all_places, lights)).cast<double>().mean();
        if (!(m > 0.0)) continue;
        lit.push_back(l);
        mean.push_back(m);
        radiosity.push_back(transport.radiosity(trial.lights[static_cast<std::size_t>(l)]));
        field.push_back(transport.gather(radiosity.back()));
    }
    if (lit.empty()) return {};

    const Index stride = std::max<Index>(1, all_places / options.places);
    const Index places = (all_places + stride - 1) / stride;
    Eigen::ArrayXd senders = Eigen::ArrayXd::Zero(places), links = senders, receivers = senders;
    parallel_for(places, [&](Index k) {
        const SurfacePoint& x = trial.places[static_cast<std::size_t>(stride * k)];
        const auto number = static_cast<std::uint64_t>(k);
        const Gathered here = gather_anew(surface, basis, sender_level, x, radiosity, half, hash64(1, number));
        std::vector<BasisEntry> row;
        basis.evaluate(display_level, x, row);
        const auto next = std::ranges::max_element(row, {}, &BasisEntry::value);
        const bool has_next = next != row.end();
        SurfacePoint point;
        Gathered there;
        if (has_next) {
            point = points.point(next->index);
            there = gather_anew(surface, basis, sender_level, point, radiosity, half, hash64(2, number));
        }
        for (std::size_t l = 0; l < lit.size(); ++l) {
            const VectorIrradiance& v = field[l];
            const auto column = static_cast<Index>(l);
            const Index of_reference = stride * k * lights + lit[l];
            const double scale = mean[l] * mean[l] * static_cast<double>(lit.size());
            const auto square = [&](const Rgb& difference, const Rgb& variance) {
                return static_cast<double>((difference.square() - variance).mean()) / scale;
            };
            senders[k] += square(here.mean.col(column) - reference.indirect.col(of_reference),
                                 here.variance.col(column) + reference.standard_error.col(of_reference).square());
            bool covered = false;
            receivers[k] += square(display.net_irradiance(x, v, covered) - here.mean.col(column), here.variance.col(column));
            if (!has_next) continue;
            const Rgb own = net_irradiance(v, next->index, point.normal);
            links[k] += square(own - there.mean.col(column), there.variance.col(column));
        }
    }, 1);
    return {part_of(senders), part_of(links), part_of(receivers - links)};
}

} // namespace afterglow
