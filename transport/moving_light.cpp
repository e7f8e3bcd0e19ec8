#include "transport/moving_light.h"

#include "core/parallel.h"

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
    coarse_.resize(3 * static_cast<std::size_t>(points.begin(points.levels() - 1)), Eigen::Vector4f::Zero());
    limiter_.emplace(points, transfer.push);
    field_.resize(9 * static_cast<std::size_t>(points.size()));
}

/// The product at a point, and what the level above predicts: x, y, z, of which R, G, B count.
std::array<Eigen::Vector4f, 3> MovingLight::pushed(Index i) const {
    std::array<Eigen::Vector4f, 3> sum;
    std::copy_n(&product_[static_cast<std::size_t>(3 * i)], 3, sum.begin());
    const SparseRows<float>& parents = transport_.transfer().push.parents;
    const auto index = parents.indices(i);
    const float* const weight = parents.values(i).data();
    for (std::size_t e = 0; e < index.size(); ++e) {
        const Eigen::Vector4f* const parent = &coarse_[3 * std::size_t{index[e]}];
        for (std::size_t a = 0; a < 3; ++a) sum[a] += weight[e] * parent[a];
    }
    return sum;
}

/// Levels up to the display level's, as far as they are not of this product already.
template <class Visit>
void MovingLight::push_levels(int levels, const Visit& visit) {
    const PointHierarchy& points = transport_.transfer().points;
    for (; levels_pushed_ < levels; ++levels_pushed_) {
        const Index first = points.begin(levels_pushed_);
        parallel_for(points.end(levels_pushed_) - first, [&](Index k) {
            const std::array<Eigen::Vector4f, 3> v = pushed(first + k);
            std::copy_n(v.begin(), 3, &coarse_[static_cast<std::size_t>(3 * (first + k))]);
            visit(first + k, v);
        }, 512);
    }
}

void MovingLight::store(Index i, const std::array<Eigen::Vector4f, 3>& value) {
    for (std::size_t a = 0; a < 3; ++a)
        std::copy_n(value[a].data(), 3, &field_[9 * static_cast<std::size_t>(i) + 3 * a]);
}

/// All levels, the last in one pass with what is asked of it: its norm, and where it is negative.
void MovingLight::push_display() {
    const PointHierarchy& points = transport_.transfer().points;
    push_levels(points.levels() - 1, [](Index, const auto&) {});
    const Index first = points.begin(points.levels() - 1), count = static_cast<Index>(points.size()) - first;
    constexpr Index grain = 1024;
    struct Part {
        double squares = 0.0;
        std::vector<std::uint32_t> negative;
    };
    std::vector<Part> parts(static_cast<std::size_t>((count + grain - 1) / grain));
    parallel_ranges(count, grain, [&](Index begin, Index end) {
        Part& part = parts[static_cast<std::size_t>(begin / grain)];
        for (Index k = begin; k < end; ++k) {
            const Index i = first + k;
            const std::array<Eigen::Vector4f, 3> v = pushed(i);
            store(i, v);
            const Vec3 n = points.normal.col(i);
            const Eigen::Vector4f irradiance = n.x() * v[0] + n.y() * v[1] + n.z() * v[2];
            if (irradiance.minCoeff() < 0.0f) part.negative.push_back(static_cast<std::uint32_t>(i));
            part.squares += static_cast<double>(
                (v[0].cwiseAbs2() + v[1].cwiseAbs2() + v[2].cwiseAbs2()).sum());
        }
    });
    parallel_for(first, [&](Index i) {
        std::array<Eigen::Vector4f, 3> v;
        std::copy_n(&coarse_[static_cast<std::size_t>(3 * i)], 3, v.begin());
        store(i, v);
    }, 4096);
    double squares = 0.0;
    negative_.clear();
    for (const Part& part : parts) {
        squares += part.squares;
        negative_.insert(negative_.end(), part.negative.begin(), part.negative.end());
    }
    field_norm_ = std::sqrt(squares);
}

std::vector<float> MovingLight::coefficients(const Radiosity& direct) {
    const TransferOperator& transfer = transport_.transfer();
    const PointHierarchy& points = transfer.points;
    levels_pushed_ = 0;
    std::vector<float> sum(4 * static_cast<std::size_t>(transfer.senders()));
    push_levels(transfer.sender_levels, [&](Index m, const std::array<Eigen::Vector4f, 3>& v) {
        const Vec3 n = points.normal.col(m), reflectance = points.reflectance.col(m);
        const Eigen::Vector4f irradiance = n.x() * v[0] + n.y() * v[1] + n.z() * v[2];
        const float* const d = &direct[3 * static_cast<std::size_t>(m)];
        float* const b = &sum[4 * static_cast<std::size_t>(m)];
        for (int c = 0; c < 3; ++c) b[c] = d[c] + reflectance[c] * irradiance[c];
    });
    transport_.make_coefficients(sum);
    return sum;
}

MovingLight::Changes MovingLight::changes(const std::vector<float>& coefficients) const {
    const double tau = waiting_share * options_.tolerance * field_norm_
                       / std::sqrt(static_cast<double>(columns_->links()));
    const auto tau2 = static_cast<float>(tau * tau);
    constexpr Index grain = 4096;
    const auto senders = static_cast<Index>(norm_.size());
    std::vector<Changes> parts(static_cast<std::size_t>((senders + grain - 1) / grain));
    parallel_ranges(senders, grain, [&](Index begin, Index end) {
        Changes& part = parts[static_cast<std::size_t>(begin / grain)];
        for (auto j = static_cast<std::uint32_t>(begin); j < end; ++j) {
            const auto now = Eigen::Array4f::Map(&coefficients[4 * std::size_t{j}]);
            const auto was = Eigen::Array4f::Map(&applied_[4 * std::size_t{j}]);
            const Eigen::Array4f change = now - was;
            const float norm2 = norm_[j] * norm_[j];
            part.both += (norm2 * now * was).cast<double>();
            part.old += (norm2 * was * was).cast<double>();
            const float effect2 = norm2 * change.square().sum();
            part.effect += static_cast<double>(effect2);
            if (effect2 <= tau2 * static_cast<float>(columns_->links_of(j))) continue;
            part.list.push_back({j, change});
            part.links += columns_->links_of(j);
        }
    });
    Changes all;
    for (const Changes& part : parts) {
        all.list.insert(all.list.end(), part.list.begin(), part.list.end());
        all.links += part.links;
        all.effect += part.effect;
        all.both += part.both;
        all.old += part.old;
    }
    all.effect = std::sqrt(all.effect);
    return all;
}

void MovingLight::start_anew(const Radiosity& direct) {
    applied_ = transport_.coefficients(transport_.all_bounces(direct));
    std::vector<LinkColumns::Change> all;
    for (std::uint32_t j = 0; j < norm_.size(); ++j)
        if (const auto c = Eigen::Vector4f::Map(&applied_[4 * j]); !c.isZero(0.0f)) all.push_back({j, c});
    std::fill(product_.begin(), product_.end(), Eigen::Vector4f::Zero());
    columns_->add_product(all, product_);
    levels_pushed_ = 0;
}

void MovingLight::scale(const Rgb& factor) {
    levels_pushed_ = 0;
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

bool MovingLight::follow_brightness(const Changes& changes) {
    Rgb factor = Rgb::Ones();
    for (int c = 0; c < 3; ++c)
        if (changes.old[c] > 0.0) factor[c] = static_cast<float>(changes.both[c] / changes.old[c]);
    if (!((factor - 1.0f).abs() > static_cast<float>(options_.tolerance)).any()) return false;
    scale(factor);
    return true;
}

void MovingLight::follow_round(const Radiosity& direct, MovingLightStatistics& s, Stopwatch& watch) {
    if (field_norm_ == 0.0) { // out of the dark there is nothing to follow
        start_anew(direct);
        s.links_share += 1.0;
        s.settled = s.anew = true;
        watch.add_to(s.links_seconds);
        return;
    }
    const std::vector<float> coefficients = this->coefficients(direct);
    Changes changed = changes(coefficients);
    if (follow_brightness(changed)) changed = changes(coefficients);
    watch.add_to(s.coefficients_seconds);
    s.settled = changed.effect <= options_.tolerance * field_norm_;
    if (s.settled) return;
    s.links_share += static_cast<double>(changed.links) / static_cast<double>(columns_->links());
    if (static_cast<double>(changed.links) > most_links * static_cast<double>(columns_->links())) {
        start_anew(direct);
        s.settled = s.anew = true;
    } else {
        columns_->add_product(changed.list, product_);
        levels_pushed_ = 0;
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
        push_display();
        (*limiter_)(negative_, field_);
        // What was small beside the field as it was may not be beside a darker one.
        if (field_norm_ < 0.9 * norm_before) s.settled = s.anew;
        watch.add_to(s.push_seconds);
    }
    if (statistics) *statistics = s;
    return field_;
}

} // namespace afterglow
