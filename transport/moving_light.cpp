#include "transport/moving_light.h"

#include "core/parallel.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>

namespace afterglow {
namespace {

/// Where so much of the links would be multiplied, solving from the start is faster.
constexpr double most_links = 0.5;
/// Of the tolerance, what changes that wait may take: less than all, so that a round that is made
/// does enough for the light to settle soon.
constexpr double waiting_share = 0.7;
/// What a round passed on counts for so much one later.
constexpr double forgetting = 0.8;
/// So many rounds without rest, and the series of rounds does not converge.
constexpr int most_rounds_without_rest = 64;

/// A link's bits as a DisplayLink has them: the exponent where floats have theirs, x, y and z from bit 0 on.
std::uint32_t display_bits(std::uint32_t packed) {
    return std::bit_cast<std::uint32_t>(LinkPacker::step_of(packed >> 7 & 31u)) | packed >> 12;
}

/// The link, and a lane of anything.
inline LinkVector vector_of_display_bits(std::uint32_t bits) {
    constexpr std::uint32_t exponent = 0x7f800000;
#ifdef __AVX2__
    const __m128i all = _mm_set1_epi32(static_cast<int>(bits));
    const __m128 step = _mm_castsi128_ps(_mm_and_si128(all, _mm_set1_epi32(exponent)));
    const __m128i top = _mm_sllv_epi32(all, _mm_setr_epi32(28, 24, 20, 28));
    LinkVector link;
    _mm_store_ps(link.data(), _mm_mul_ps(_mm_cvtepi32_ps(_mm_srai_epi32(top, 28)), step));
    return link;
#else
    const auto component = [&](int c) {
        return static_cast<float>(static_cast<std::int32_t>(bits << (28 - 4 * c)) >> 28);
    };
    return std::bit_cast<float>(bits & exponent) * LinkVector(component(0), component(1), component(2), 0.0f);
#endif
}

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
    if (!follows()) return;
    const PointHierarchy& points = transport.transfer().points;
    const std::size_t coarse = points.begin(points.levels() - 1);
    product_.resize(3 * coarse, Eigen::Vector4f::Zero());
    coarse_.resize(coarse);
    field_.resize(9 * static_cast<std::size_t>(points.size()));
}

bool MovingLight::follows() const {
    const TransferOperator& transfer = transport_.transfer();
    return transfer.kind == OperatorKind::neumann && transfer.bounces == 0
           && transfer.sender_levels < transfer.points.levels();
}

std::vector<MovingLight::Part> MovingLight::make_parts(const TransferOperator& transfer) {
    const PointHierarchy& points = transfer.points;
    std::vector<Part> parts;
    for (int l = 0; l + 1 < points.levels(); ++l) {
        LinkColumns columns(transfer.links, transfer.senders(), points.begin(l), points.end(l));
        // What a receiver has, all points of the display level around it get by the push.
        const float ratio = points.spacing[l] / points.spacing.back();
        std::vector<float> norm2 =
            columns.norms(std::vector<float>(points.end(l) - points.begin(l), ratio * ratio));
        for (float& norm : norm2) norm *= norm;
        parts.push_back({std::move(columns), std::move(norm2), {}});
    }
    return parts;
}

void MovingLight::await_parts() {
    if (!coming_parts_.valid()) return;
    parts_ = coming_parts_.get();
    links_ = 0;
    for (Part& part : parts_) {
        part.applied = coefficients_;
        links_ += part.columns.links();
    }
}

/// So that their short rows need no steps from sender to sender.
void MovingLight::unpack_display_links() {
    const TransferOperator& transfer = transport_.transfer();
    const Index first = transfer.points.begin(transfer.points.levels() - 1);
    const Index count = static_cast<Index>(transfer.points.size()) - first;
    display_begin_.resize(static_cast<std::size_t>(count + 1));
    parallel_for(count, [&](Index k) {
        display_begin_[static_cast<std::size_t>(k + 1)] = transfer.links.count(first + k, first + k + 1);
    }, 4096);
    for (std::size_t k = 1; k < display_begin_.size(); ++k) display_begin_[k] += display_begin_[k - 1];
    display_links_.resize(display_begin_.back());
    parallel_for(count, [&](Index k) {
        DisplayLink* to = display_links_.data() + display_begin_[static_cast<std::size_t>(k)];
        transfer.links.for_each_packed(first + k, [&](std::uint32_t sender, std::uint32_t bits) { *to++ = {sender, display_bits(bits)}; });
    }, 4096);
}

/// A product, and what the level above predicts there.
inline MovingLight::Padded MovingLight::with_prediction(Index i, const Eigen::Vector4f& px, const Eigen::Vector4f& py,
                                                        const Eigen::Vector4f& pz) const {
    const SparseRows<float>& parents = transport_.transfer().push.parents;
    const std::uint64_t end = parents.begin[static_cast<std::size_t>(i + 1)];
    const std::uint32_t* const index = parents.index.data();
    const float* const weight = parents.value.data();
    const Padded* const coarse = coarse_.data();
    Eigen::Vector4f x = px, y = py, z = pz; // not in memory
    for (std::uint64_t e = parents.begin[static_cast<std::size_t>(i)]; e < end; ++e) {
        const Padded& parent = coarse[index[e]];
        x += weight[e] * parent[0];
        y += weight[e] * parent[1];
        z += weight[e] * parent[2];
    }
    return {x, y, z};
}

/// Levels up to the display level's, as far as they are not of this product already.
template <class Visit>
void MovingLight::push_levels(int levels, const Visit& visit) {
    const PointHierarchy& points = transport_.transfer().points;
    for (; levels_pushed_ < levels; ++levels_pushed_) {
        const Index first = points.begin(levels_pushed_);
        parallel_for(points.end(levels_pushed_) - first, [&](Index k) {
            const Eigen::Vector4f* const product = &product_[static_cast<std::size_t>(3 * (first + k))];
            const Padded v = with_prediction(first + k, product[0], product[1], product[2]);
            coarse_[static_cast<std::size_t>(first + k)] = v;
            store(first + k, v);
            visit(first + k, v);
        }, 512);
    }
}

void MovingLight::store(Index i, const Padded& value) {
    using Four = Eigen::Map<Eigen::Vector4f>;
    float* const to = &field_[9 * static_cast<std::size_t>(i)]; // nine numbers: what goes too far is written over
    Four(to + 0) = value[0];
    Four(to + 3) = value[1];
    Four(to + 5) = Eigen::Vector4f(value[1][2], value[2][0], value[2][1], value[2][2]);
}

/// All levels, the last in one pass with what is asked of it: its norm, and where it is negative.
void MovingLight::push_display() {
    const PointHierarchy& points = transport_.transfer().points;
    if (display_begin_.empty()) unpack_display_links();
    push_levels(points.levels() - 1, [](Index, const Padded&) {});
    const Index first = points.begin(points.levels() - 1), count = static_cast<Index>(points.size()) - first;
    constexpr Index grain = 1024;
    struct Chunk {
        double squares = 0.0;
        std::vector<std::uint32_t> negative;
    };
    std::vector<Chunk> chunks(static_cast<std::size_t>((count + grain - 1) / grain));
    parallel_ranges(count, grain, [&](Index begin, Index end) {
        Chunk& chunk = chunks[static_cast<std::size_t>(begin / grain)];
        const std::uint64_t* const begins = display_begin_.data();
        const DisplayLink* const links = display_links_.data();
        const float* const coefficients = coefficients_.data();
        for (Index k = begin; k < end; ++k) {
            const Index i = first + k;
            Eigen::Vector4f x = Eigen::Vector4f::Zero(), y = x, z = x;
            for (std::uint64_t e = begins[k]; e < begins[k + 1]; ++e) {
                const LinkVector link = vector_of_display_bits(links[e].bits);
                const Eigen::Vector4f c = Eigen::Vector4f::Map(coefficients + 4 * std::size_t{links[e].sender});
                x += link.x() * c;
                y += link.y() * c;
                z += link.z() * c;
            }
            const Padded v = with_prediction(i, x, y, z);
            store(i, v);
            if (net_irradiance(v[0].data(), points.normal.col(i)).minCoeff() < 0.0f)
                chunk.negative.push_back(static_cast<std::uint32_t>(i));
            chunk.squares += static_cast<double>(
                (v[0].cwiseAbs2() + v[1].cwiseAbs2() + v[2].cwiseAbs2()).sum());
        }
    });
    double squares = 0.0;
    negative_.clear();
    for (const Chunk& chunk : chunks) {
        squares += chunk.squares;
        negative_.insert(negative_.end(), chunk.negative.begin(), chunk.negative.end());
    }
    field_norm_ = std::sqrt(squares);
}

void MovingLight::make_coefficients(const Radiosity& direct) {
    const TransferOperator& transfer = transport_.transfer();
    const PointHierarchy& points = transfer.points;
    coefficients_.resize(4 * static_cast<std::size_t>(transfer.senders()));
    const auto radiate = [&](Index m, const Padded& v) {
        const Vec3 reflectance = points.reflectance.col(m);
        const Eigen::Array4f irradiance = net_irradiance(v[0].data(), points.normal.col(m));
        const float* const d = &direct[3 * static_cast<std::size_t>(m)];
        float* const b = &coefficients_[4 * static_cast<std::size_t>(m)];
        for (int c = 0; c < 3; ++c) b[c] = d[c] + reflectance[c] * irradiance[c];
    };
    const Index known = points.begin(std::min(levels_pushed_, transfer.sender_levels));
    parallel_for(known, [&](Index m) { radiate(m, coarse_[static_cast<std::size_t>(m)]); }, 1024);
    push_levels(transfer.sender_levels, radiate);
    transport_.make_coefficients(coefficients_);
}

MovingLight::Changes MovingLight::changes() const {
    const double tau = waiting_share * options_.tolerance * field_norm_ / std::sqrt(static_cast<double>(links_));
    const auto tau2 = static_cast<float>(tau * tau);
    constexpr Index grain = 2048;
    const auto senders = static_cast<Index>(coefficients_.size() / 4);
    const Index chunks = (senders + grain - 1) / grain;
    struct Chunk {
        Changes sums; // without a list
        std::vector<LinkColumns::Change> list;
    };
    std::vector<Chunk> some(static_cast<std::size_t>(chunks) * parts_.size());
    parallel_for(static_cast<Index>(some.size()), [&](Index chunk) {
        auto& [sums, list] = some[static_cast<std::size_t>(chunk)];
        const Part& part = parts_[static_cast<std::size_t>(chunk / chunks)];
        const Index begin = chunk % chunks * grain, end = std::min(senders, begin + grain);
        Eigen::Array4f both = Eigen::Array4f::Zero(), old = both, effect = both, waiting = both;
        for (auto j = static_cast<std::uint32_t>(begin); j < end; ++j) {
            const float norm2 = part.norm2[j];
            const Eigen::Array4f now = Eigen::Array4f::Map(&coefficients_[4 * std::size_t{j}]);
            const Eigen::Array4f was = Eigen::Array4f::Map(&part.applied[4 * std::size_t{j}]);
            const Eigen::Array4f change = now - was, effect2 = norm2 * change.square();
            both += norm2 * now * was;
            old += norm2 * was.square();
            effect += effect2;
            if (effect2.sum() <= tau2 * static_cast<float>(part.columns.links_of(j))) {
                waiting += effect2;
                continue;
            }
            list.push_back({j, change});
            sums.links += part.columns.links_of(j);
        }
        sums.both = both.cast<double>();
        sums.old = old.cast<double>();
        sums.effect2 = effect.cast<double>().sum();
        sums.waiting2 = waiting.cast<double>().sum();
    }, 1);
    Changes all;
    all.list.resize(parts_.size());
    for (std::size_t k = 0; k < some.size(); ++k) {
        const auto& [sums, list] = some[k];
        std::vector<LinkColumns::Change>& to = all.list[k / static_cast<std::size_t>(chunks)];
        to.insert(to.end(), list.begin(), list.end());
        all.links += sums.links;
        all.effect2 += sums.effect2;
        all.waiting2 += sums.waiting2;
        all.both += sums.both;
        all.old += sums.old;
    }
    return all;
}

void MovingLight::apply(const Changes& changes) {
    struct Block {
        std::size_t part;
        Index block;
    };
    std::vector<Block> blocks;
    for (std::size_t p = 0; p < parts_.size(); ++p)
        for (Index b = 0; b < parts_[p].columns.blocks(); ++b) blocks.push_back({p, b});
    const PointHierarchy& points = transport_.transfer().points;
    parallel_for(static_cast<Index>(blocks.size()), [&](Index k) {
        const auto [p, block] = blocks[static_cast<std::size_t>(k)];
        parts_[p].columns.add_product(block, changes.list[p],
                                      std::span(product_).subspan(3 * std::size_t{points.begin(static_cast<int>(p))}));
    }, 1);
    for (std::size_t p = 0; p < parts_.size(); ++p)
        for (const LinkColumns::Change& change : changes.list[p])
            std::copy_n(&coefficients_[4 * std::size_t{change.sender}], 4, &parts_[p].applied[4 * std::size_t{change.sender}]);
    levels_pushed_ = 0;
}

void MovingLight::start_anew(const Radiosity& direct) {
    coefficients_ = transport_.coefficients(transport_.all_bounces(direct));
    parallel_for(static_cast<Index>(product_.size() / 3), [&](Index i) {
        const LinkProduct product = multiply_row(transport_.transfer().links, i, coefficients_.data());
        for (std::size_t a = 0; a < 3; ++a)
            product_[3 * static_cast<std::size_t>(i) + a] = Eigen::Vector4f::Map(&product[4 * a]);
    }, 32);
    for (Part& part : parts_) part.applied = coefficients_;
    levels_pushed_ = 0;
}

void MovingLight::scale(const Rgb& factor) {
    levels_pushed_ = 0;
    const Eigen::Vector4f f(factor[0], factor[1], factor[2], 0.0f);
    for (Part& part : parts_)
        parallel_for(static_cast<Index>(part.norm2.size()), [&](Index j) {
            auto c = Eigen::Vector4f::Map(&part.applied[4 * static_cast<std::size_t>(j)]);
            c = c.cwiseProduct(f).eval();
        }, 8192);
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

void MovingLight::Forecast::found(double effect2) {
    if (multiplied2_ == 0.0) return;
    const double came2 = std::max(0.0, effect2 - waiting2_);
    passed_on_ = std::max(std::sqrt(came2 / multiplied2_), forgetting * passed_on_);
}

double MovingLight::Forecast::made(double effect2, double waiting2) {
    waiting2_ = waiting2;
    multiplied2_ = std::max(0.0, effect2 - waiting2);
    return waiting2_ + passed_on_ * passed_on_ * multiplied2_;
}

void MovingLight::follow_round(const Radiosity& direct, MovingLightStatistics& s, Stopwatch& watch) {
    // Out of the dark there is nothing to follow, nor where all is too bright to compare, or comes to no rest.
    if (field_norm_ == 0.0 || !std::isfinite(field_norm_) || parts_.empty() || ++rounds_without_rest_ > most_rounds_without_rest) {
        start_anew(direct);
        rounds_without_rest_ = 0;
        s.links_share += 1.0;
        s.settled = s.anew = true;
        watch.add_to(s.links_seconds);
        return;
    }
    make_coefficients(direct);
    Changes changed = changes();
    if (follow_brightness(changed)) changed = changes();
    watch.add_to(s.coefficients_seconds);
    forecast_.found(changed.effect2);
    const double settled2 = std::pow(options_.tolerance * field_norm_, 2);
    s.settled = changed.effect2 <= settled2;
    if (s.settled) {
        rounds_without_rest_ = 0;
        return;
    }
    const double share = static_cast<double>(changed.links) / static_cast<double>(links_);
    s.links_share += share;
    if (share > most_links) {
        start_anew(direct);
        s.settled = s.anew = true;
    } else {
        apply(changed);
        s.settled = forecast_.made(changed.effect2, changed.waiting2) <= settled2;
    }
    if (s.settled) rounds_without_rest_ = 0;
    watch.add_to(s.links_seconds);
}

const VectorIrradiance& MovingLight::follow(const Spotlight& light, MovingLightStatistics* statistics) {
    MovingLightStatistics s;
    Stopwatch watch;
    if (!follows()) {
        field_ = transport_.indirect(light);
        watch.add_to(s.links_seconds);
        s.settled = s.anew = true;
        if (statistics) *statistics = s;
        return field_;
    }
    await_parts();
    if (!light_ || !light_->shines_alike(light) || (light_->intensity != light.intensity).any()) rounds_without_rest_ = 0;
    follow_intensity(light);
    const Radiosity direct = transport_.direct_radiosity(light);
    watch.add_to(s.direct_seconds);
    forecast_.begin_pose();
    while (!s.settled && (s.rounds < options_.most_rounds || options_.most_rounds == 0)) {
        ++s.rounds;
        const double norm_before = field_norm_;
        follow_round(direct, s, watch);
        if (!s.settled && s.rounds != options_.most_rounds) continue;
        push_display();
        if (!limiter_ && !negative_.empty()) {
            const TransferOperator& transfer = transport_.transfer();
            limiter_.emplace(transfer.points, transfer.push);
        }
        if (limiter_) (*limiter_)(negative_, field_);
        // What was small beside the field as it was may not be beside a darker one.
        if (field_norm_ < 0.9 * norm_before) s.settled = s.anew;
        watch.add_to(s.push_seconds);
    }
    if (parts_.empty())
        coming_parts_ = std::async(std::launch::async, [&transfer = transport_.transfer()] { return make_parts(transfer); });
    if (statistics) *statistics = s;
    return field_;
}

} // namespace afterglow
