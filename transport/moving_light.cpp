#include "transport/moving_light.h"

#include "core/parallel.h"
#include "transport/positivity.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace afterglow {
namespace {

/// Where so much of the links would be multiplied, solving from the start is faster.
constexpr double most_links = 0.5;
/// Of the tolerance, what changes that wait may take: less than all, so that a round that is made
/// does enough for the light to settle soon.
constexpr double waiting_share = 0.7;

} // namespace

class MovingLight::Stopwatch {
public:
    /// Seconds since the last call, added to `sum`.
    void add_to(double& sum) {
        const Clock::time_point now = Clock::now();
        sum += std::chrono::duration<double>(now - last_).count();
        last_ = now;
    }

private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point last_ = Clock::now();
};

MovingLight::MovingLight(const LightTransport& transport, const Options& options)
    : transport_(transport), options_(options) {
    const TransferOperator& transfer = transport.transfer();
    if (transfer.kind != OperatorKind::neumann || transfer.bounces != 0) return;
    const PointHierarchy& points = transfer.points;
    columns_.emplace(transfer.links, transfer.senders());
    // What a receiver has, all points of the display level around it get by the push.
    std::vector<float> weights(points.size());
    for (int l = 0; l < points.levels(); ++l) {
        const float ratio = points.spacing[l] / points.spacing.back();
        std::fill(weights.begin() + points.begin(l), weights.begin() + points.end(l), ratio * ratio);
    }
    norm_ = columns_->norms(weights);
    applied_.resize(4 * static_cast<std::size_t>(transfer.senders()));
    product_.resize(3 * static_cast<std::size_t>(points.size()), Eigen::Vector4f::Zero());
    field_.resize(9 * static_cast<std::size_t>(points.size()));
}

void MovingLight::push_field(int levels) {
    const PointHierarchy& points = transport_.transfer().points;
    parallel_for(points.end(levels - 1), [&](Index i) {
        for (int a = 0; a < 3; ++a)
            std::copy_n(product_[static_cast<std::size_t>(3 * i + a)].data(), 3, &field_[static_cast<std::size_t>(9 * i + 3 * a)]);
    }, 4096);
    transport_.transfer().push.push(points, levels, 9, field_);
}

Radiosity MovingLight::radiosity(const Radiosity& direct) {
    const TransferOperator& transfer = transport_.transfer();
    push_field(transfer.sender_levels);
    Radiosity sum(direct.size());
    parallel_for(transfer.senders(), [&](Index m) {
        const Vec3 n = transfer.points.normal.col(m);
        const float* v = &field_[static_cast<std::size_t>(9 * m)];
        for (int c = 0; c < 3; ++c) {
            const auto at = static_cast<std::size_t>(3 * m + c);
            sum[at] = direct[at] + transfer.points.reflectance(c, m)
                                       * (n.x() * v[c] + n.y() * v[3 + c] + n.z() * v[6 + c]);
        }
    }, 1024);
    return sum;
}

MovingLight::Changes MovingLight::changes(const std::vector<float>& coefficients) const {
    const double tau = waiting_share * options_.tolerance * field_norm_
                       / std::sqrt(static_cast<double>(columns_->links()));
    Changes found;
    for (std::uint32_t j = 0; j < norm_.size(); ++j) {
        const Eigen::Vector4f change = Eigen::Vector4f::Map(&coefficients[4 * j]) - Eigen::Vector4f::Map(&applied_[4 * j]);
        const double effect = change.norm() * norm_[j];
        found.effect += effect * effect;
        if (effect * effect <= tau * tau * columns_->links_of(j)) continue;
        found.list.push_back({j, change});
        found.links += columns_->links_of(j);
    }
    found.effect = std::sqrt(found.effect);
    return found;
}

void MovingLight::start_anew(const Radiosity& direct) {
    applied_ = transport_.coefficients(transport_.all_bounces(direct));
    std::vector<LinkColumns::Change> all;
    for (std::uint32_t j = 0; j < norm_.size(); ++j)
        all.push_back({j, Eigen::Vector4f::Map(&applied_[4 * j])});
    std::fill(product_.begin(), product_.end(), Eigen::Vector4f::Zero());
    columns_->add_product(all, product_);
}

void MovingLight::scale(const Rgb& factor) {
    const Eigen::Vector4f f(factor[0], factor[1], factor[2], 0.0f);
    for (std::size_t j = 0; j < norm_.size(); ++j)
        Eigen::Vector4f::Map(&applied_[4 * j]) = Eigen::Vector4f::Map(&applied_[4 * j]).cwiseProduct(f);
    parallel_for(static_cast<Index>(product_.size()), [&](Index k) {
        product_[static_cast<std::size_t>(k)] = product_[static_cast<std::size_t>(k)].cwiseProduct(f);
    }, 8192);
}

void MovingLight::follow_intensity(const Spotlight& light) {
    if (light_ && light_->shines_alike(light) && (light_->intensity > 0.0f).all()
        && (light_->intensity != light.intensity).any()) {
        const Rgb factor = light.intensity / light_->intensity;
        if (factor.isFinite().all()) {
            scale(factor);
            field_norm_ *= factor.maxCoeff();
        }
    }
    light_ = light;
}

void MovingLight::follow_brightness(const std::vector<float>& coefficients) {
    Eigen::Array4d both = Eigen::Array4d::Zero(), old = Eigen::Array4d::Zero();
    for (std::size_t j = 0; j < norm_.size(); ++j) {
        const Eigen::Array4d was = Eigen::Array4f::Map(&applied_[4 * j]).cast<double>() * norm_[j];
        both += was * Eigen::Array4f::Map(&coefficients[4 * j]).cast<double>() * norm_[j];
        old += was * was;
    }
    Rgb factor = Rgb::Ones();
    for (int c = 0; c < 3; ++c)
        if (old[c] > 0.0) factor[c] = static_cast<float>(both[c] / old[c]);
    if (((factor - 1.0f).abs() > static_cast<float>(options_.tolerance)).any()) scale(factor);
}

double MovingLight::display_norm() const {
    const PointHierarchy& points = transport_.transfer().points;
    const Index first = 9 * static_cast<Index>(points.begin(points.levels() - 1));
    return std::sqrt(parallel_sum(9 * static_cast<Index>(points.size()) - first, 0.0, [&](Index k) {
        const double v = field_[static_cast<std::size_t>(first + k)];
        return v * v;
    }, 16384));
}

void MovingLight::follow_round(const Radiosity& direct, MovingLightStatistics& s, Stopwatch& watch) {
    const std::vector<float> coefficients = transport_.coefficients(radiosity(direct));
    follow_brightness(coefficients);
    const Changes changed = changes(coefficients);
    watch.add_to(s.coefficients_seconds);
    s.settled = changed.effect <= options_.tolerance * field_norm_;
    if (s.settled) return;
    s.links_share += static_cast<double>(changed.links) / static_cast<double>(columns_->links());
    if (static_cast<double>(changed.links) > most_links * static_cast<double>(columns_->links())) {
        start_anew(direct);
        s.settled = s.anew = true;
    } else {
        columns_->add_product(changed.list, product_);
        for (const LinkColumns::Change& change : changed.list)
            std::copy_n(&coefficients[4 * change.sender], 4, &applied_[4 * change.sender]);
    }
    watch.add_to(s.links_seconds);
}

const VectorIrradiance& MovingLight::follow(const Spotlight& light, MovingLightStatistics* statistics) {
    MovingLightStatistics s;
    Stopwatch watch;
    if (!columns_) {
        field_ = transport_.indirect(light);
        watch.add_to(s.links_seconds);
        s.settled = s.anew = true;
        if (statistics) *statistics = s;
        return field_;
    }
    follow_intensity(light);
    const Radiosity direct = transport_.direct_radiosity(light);
    watch.add_to(s.direct_seconds);
    while (!s.settled && (s.rounds < options_.most_rounds || options_.most_rounds == 0)) {
        ++s.rounds;
        const double norm_before = field_norm_;
        follow_round(direct, s, watch);
        if (!s.settled && s.rounds != options_.most_rounds) continue;
        const TransferOperator& transfer = transport_.transfer();
        push_field(transfer.points.levels());
        make_positive(transfer.points, transfer.push, field_);
        field_norm_ = display_norm();
        // What was small beside the field as it was may not be beside a darker one.
        if (field_norm_ < 0.9 * norm_before) s.settled = s.anew;
        watch.add_to(s.push_seconds);
    }
    if (statistics) *statistics = s;
    return field_;
}

} // namespace afterglow
