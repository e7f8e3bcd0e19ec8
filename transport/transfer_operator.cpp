#include "transport/transfer_operator.h"

#include "core/parallel.h"
#include "transport/krylov.h"
#include "transport/link_products.h"
#include "transport/positivity.h"

#include <algorithm>
#include <array>
#include <tuple>

namespace afterglow {

const char* operator_name(OperatorKind kind) {
    return kind == OperatorKind::paper ? "paper" : "neumann";
}

std::uint64_t TransferOperator::link_count(int level) const {
    const std::uint32_t first = points.begin(level), last = points.end(level);
    return kind == OperatorKind::paper ? solution.begin[last] - solution.begin[first]
                                       : links.count(first, last);
}

std::uint64_t TransferOperator::link_count() const {
    return kind == OperatorKind::paper ? solution.entries() : links.count(0, links.rows());
}

std::uint64_t TransferOperator::link_bytes(int level) const {
    const std::uint32_t first = points.begin(level), last = points.end(level);
    return kind == OperatorKind::paper
               ? (solution.begin[last] - solution.begin[first]) * (sizeof(std::uint32_t) + sizeof(RgbLink))
               : (links.begin[last] - links.begin[first]) * sizeof(PackedLink);
}

LightTransport::LightTransport(const TransferOperator& transfer, const Surface& surface)
    : transfer_(transfer), surface_(surface) {
    if (transfer.kind == OperatorKind::neumann)
        direct_light_.emplace(transfer.points, transfer.sender_levels - 1, transfer.sender_areas,
                              surface);
}

Radiosity LightTransport::direct_radiosity(const Spotlight& light) const {
    const PointHierarchy& points = transfer_.points;
    Radiosity radiosity(3 * static_cast<std::size_t>(transfer_.senders()));
    const std::size_t finest = points.begin(transfer_.sender_levels - 1);
    direct_light_->radiosity(light, std::span(radiosity).subspan(3 * finest));
    transfer_.pull.pull(points, transfer_.sender_levels, 3, radiosity);
    return radiosity;
}

std::vector<float> LightTransport::coefficients(const Radiosity& radiosity) const {
    std::vector<float> padded(4 * static_cast<std::size_t>(transfer_.senders()), 0.0f);
    parallel_for(transfer_.senders(), [&](Index m) { std::copy_n(&radiosity[3 * m], 3, &padded[4 * m]); }, 4096);
    make_coefficients(padded);
    return padded;
}

void LightTransport::make_coefficients(std::vector<float>& radiosity) const {
    const PointHierarchy& points = transfer_.points;
    transfer_.pull.pull(points, transfer_.sender_levels, 4, radiosity);
    transfer_.push.difference(points, transfer_.sender_levels, 4, radiosity);
    transfer_.pull.update(points, transfer_.sender_levels, 4, radiosity);
}

std::vector<float> LightTransport::apply_links(const std::vector<float>& coefficients, int levels) const {
    const PointHierarchy& points = transfer_.points;
    const Index receivers = points.end(levels - 1);
    constexpr std::size_t channels = std::tuple_size_v<LinkProduct>;
    std::vector<float> field(channels * static_cast<std::size_t>(receivers));
    parallel_for(
        receivers,
        [&](Index i) {
            const LinkProduct product = multiply_row(transfer_.links, i, coefficients.data());
            std::copy_n(product.data(), channels, &field[channels * static_cast<std::size_t>(i)]);
        },
        32);
    transfer_.push.push(points, levels, channels, field);
    return field;
}

Radiosity LightTransport::bounce(const Radiosity& radiosity) const {
    const PointHierarchy& points = transfer_.points;
    const std::vector<float> field = apply_links(coefficients(radiosity), transfer_.sender_levels);
    Radiosity next(radiosity.size());
    parallel_for(
        transfer_.senders(),
        [&](Index m) {
            Rgb::Map(&next[3 * static_cast<std::size_t>(m)]) =
                points.reflectance.col(m).array()
                * net_irradiance(&field[12 * static_cast<std::size_t>(m)], points.normal.col(m)).head<3>();
        },
        1024);
    return next;
}

Radiosity LightTransport::all_bounces(const Radiosity& direct, double tolerance,
                                      NeumannStatistics* statistics) const {
    const KrylovResult result = solve_second_kind(
        [&](const std::vector<float>& f) { return bounce(f); }, direct, 3, tolerance);
    if (statistics) *statistics = {result.products, result.residual};
    return result.solution;
}

Radiosity LightTransport::some_bounces(const Radiosity& direct, int count) const {
    Radiosity last = direct, sum = direct;
    for (int k = 1; k < count; ++k) {
        last = bounce(last);
        for (std::size_t m = 0; m < sum.size(); ++m) sum[m] += last[m];
    }
    return sum;
}

VectorIrradiance LightTransport::gather(const Radiosity& radiosity) const {
    const std::vector<float> padded = apply_links(coefficients(radiosity), transfer_.points.levels());
    VectorIrradiance field(9 * static_cast<std::size_t>(transfer_.points.size()));
    parallel_for(transfer_.points.size(), [&](Index i) {
        for (std::size_t a = 0; a < 3; ++a)
            std::copy_n(&padded[12 * static_cast<std::size_t>(i) + 4 * a], 3, &field[9 * static_cast<std::size_t>(i) + 3 * a]);
    }, 4096);
    return field;
}

/// S e, where e are the coefficients of direct irradiance.
VectorIrradiance LightTransport::apply_paper(const std::vector<float>& direct_irradiance) const {
    const PointHierarchy& points = transfer_.points;
    std::vector<float> e(direct_irradiance);
    transfer_.pull.pull(points, transfer_.sender_levels, 3, e);
    transfer_.pyramid.analyse(points, transfer_.sender_levels, 3, e);
    VectorIrradiance field(9 * static_cast<std::size_t>(points.size()));
    parallel_for(
        points.size(),
        [&](Index i) {
            RgbLink sum = RgbLink::Zero();
            const auto sender = transfer_.solution.indices(i);
            const auto link = transfer_.solution.values(i);
            for (std::size_t k = 0; k < sender.size(); ++k)
                sum += link[k] * Rgb::Map(&e[3 * std::size_t{sender[k]}]).replicate<3, 1>();
            RgbLink::Map(&field[9 * i]) = sum;
        },
        256);
    return field;
}

Radiosity LightTransport::radiosity(const Spotlight& light, NeumannStatistics* statistics,
                                    double tolerance) const {
    const Radiosity direct = direct_radiosity(light);
    if (transfer_.bounces == 0) return all_bounces(direct, tolerance, statistics);
    if (statistics) *statistics = {.products = transfer_.bounces - 1};
    return some_bounces(direct, transfer_.bounces);
}

VectorIrradiance LightTransport::indirect(const Spotlight& light, NeumannStatistics* statistics,
                                          double tolerance) const {
    if (transfer_.kind == OperatorKind::paper) {
        if (statistics) *statistics = {};
        const PointHierarchy& points = transfer_.points;
        std::vector<float> e(3 * static_cast<std::size_t>(transfer_.senders()));
        parallel_for(
            transfer_.senders(),
            [&](Index m) { Rgb::Map(&e[3 * m]) = direct_irradiance(surface_, light, points.point(m)); },
            256);
        return apply_paper(e);
    }
    VectorIrradiance field = gather(radiosity(light, statistics, tolerance));
    make_positive(transfer_.points, transfer_.push, field);
    return field;
}

} // namespace afterglow
