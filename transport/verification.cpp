#include "transport/verification.h"

#include "basis/candidates.h"
#include "core/sampling.h"
#include "transport/display.h"
#include "transport/error_parts.h"
#include "transport/transfer_operator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace afterglow {
namespace {

/// Places in the open where light passes: on the way from a place that particles reach to the next
/// surface, and not in a gap or close to a wall. A lamp can be there, and an eye.
class FreePlaces {
public:
    FreePlaces(const Surface& surface, const std::vector<Vec3>& viewpoints, std::uint64_t seed)
        : surface_(surface), source_(surface, viewpoints, seed), rng_(seed, 0xf4ee) {}

    Vec3 next() {
        // Where nothing is open, as in a crack, the last will do.
        Vec3 place = draw();
        for (int tries = 0; tries < 100 && !is_open(place); ++tries) place = draw();
        return place;
    }
    float uniform() { return rng_.uniform(); }
    Vec2 uniform2() {
        const float u = rng_.uniform();
        return {u, rng_.uniform()};
    }

private:
    const Surface& surface_;
    CandidateSource source_;
    Rng rng_;
    std::size_t candidate_ = 0;

    Vec3 draw() {
        source_.ensure(candidate_ + 1);
        const SurfacePoint x = source_[candidate_].at;
        candidate_ += 97; // not the next vertex of the same path
        const Ray ray{surface_.lifted(x), Frame(x.normal).to_world(sample_cosine(uniform2()))};
        const Hit hit = surface_.closest_hit(ray);
        const auto longest = 2.0f * static_cast<float>(source_.mean_ray_length());
        const float length = hit ? std::min(hit.distance, longest) : longest;
        return ray.origin + (0.25f + 0.5f * rng_.uniform()) * length * ray.direction;
    }

    /// Whether the harmonic mean of the distances around is half of what light travels here, and most
    /// of what is around is the scene, as inside it.
    bool is_open(const Vec3& place) const {
        constexpr std::uint32_t rays = 64;
        double inverse = 0.0;
        std::uint32_t hits = 0;
        for (std::uint32_t k = 0; k < rays; ++k)
            if (const Hit hit = surface_.closest_hit({place, sample_sphere(scrambled_sobol2(k, 5))})) {
                inverse += 1.0 / hit.distance;
                ++hits;
            }
        return 10 * hits >= 6 * rays && hits > inverse * source_.mean_ray_length() / 2.0;
    }
};

Spotlight random_spotlight(const Surface& surface, FreePlaces& free) {
    Spotlight light;
    light.position = free.next();
    float farthest = -1.0f;
    for (int k = 0; k < 4; ++k) {
        const Vec3 direction = sample_sphere(free.uniform2());
        const Hit hit = surface.closest_hit({light.position, direction});
        if (const float far = hit ? hit.distance : 0.0f; far > farthest) {
            farthest = far;
            light.direction = direction;
        }
    }
    light.outer_angle = 20.0f + 30.0f * free.uniform();
    light.inner_angle = light.outer_angle - 5.0f;
    light.check();
    return light;
}

/// Of one and more that are independent of each other.
ErrorPart root_mean_square(const std::vector<ErrorPart>& parts) {
    if (parts.empty()) return {};
    const auto count = static_cast<double>(parts.size());
    double squares = 0.0, variance = 0.0; // the latter of the former
    for (const ErrorPart& part : parts) {
        squares += part.rms * part.rms;
        variance += std::pow(2.0 * part.rms * part.standard_error, 2);
    }
    const double rms = std::sqrt(squares / count);
    return {rms, rms > 0.0 ? std::sqrt(variance) / count / (2.0 * rms) : 0.0};
}

} // namespace

Trial random_trial(const Surface& surface, const std::vector<Vec3>& viewpoints, int lights, int places,
                   std::uint64_t seed) {
    FreePlaces free(surface, viewpoints, seed);
    Trial trial;
    for (int l = 0; l < lights; ++l) {
        trial.lights.push_back(random_spotlight(surface, free));
        trial.eyes.push_back(trial.lights.back().position);
        trial.eyes.push_back(free.next());
    }
    const auto eyes = static_cast<std::uint32_t>(trial.eyes.size());
    for (std::uint32_t k = 0; static_cast<int>(trial.places.size()) < places; ++k) {
        if (k >= 100u * static_cast<std::uint32_t>(places)) return {};
        const std::uint32_t eye = k % eyes; // each has a sequence of its own: every second point has half the directions
        const Vec3 direction = sample_sphere(scrambled_sobol2(k / eyes, hash64(seed, 0x9147 + eye)));
        if (const Hit hit = surface.closest_hit({trial.eyes[eye], direction})) trial.places.push_back(surface.point(hit));
    }
    Rng rng(seed, 0x9147); // in no order: some of them are as good as all
    for (std::size_t k = trial.places.size(); k > 1; --k)
        std::swap(trial.places[k - 1], trial.places[static_cast<std::size_t>(rng.next() % k)]);
    return trial;
}

std::string VerifiedError::text() const {
    std::array<char, 200> line{};
    std::snprintf(line.data(), line.size(),
                  "%.1f %% +- %.1f (relRMSE of indirect irradiance, %d points, %d random spotlights; the worst %.1f %%)",
                  100.0 * rel_rmse, 100.0 * standard_error, places, lights, 100.0 * worst);
    return line.data();
}

VerifiedError compare_with_reference(const Eigen::Array3Xf& found, const Eigen::Array3Xf& reference,
                                     const Eigen::Array3Xf& standard_error) {
    constexpr Index groups = 20;
    const Index places = found.cols();
    const double mean = reference.cast<double>().mean();
    // Of each place: its squared error, without what the reference's variance adds on average.
    const Eigen::ArrayXd square =
        ((found - reference).cast<double>().square() - standard_error.cast<double>().square())
            .colwise().mean().transpose();
    const auto rel_rmse = [&](double sum, Index count) {
        return std::sqrt(std::max(0.0, sum / static_cast<double>(count))) / mean;
    };
    VerifiedError error;
    error.places = static_cast<int>(places);
    error.rel_rmse = error.worst = rel_rmse(square.sum(), places);
    error.lights = 1;
    error.bias = found.cast<double>().mean() / mean - 1.0;
    error.reference_error = std::sqrt(standard_error.cast<double>().square().mean()) / mean;
    double spread = 0.0, centre = 0.0;
    std::array<double, groups> without;
    for (Index g = 0; g < groups; ++g) {
        double sum = square.sum();
        Index count = places;
        for (Index k = g; k < places; k += groups) {
            sum -= square[k];
            --count;
        }
        without[static_cast<std::size_t>(g)] = rel_rmse(sum, count);
        centre += without[static_cast<std::size_t>(g)] / groups;
    }
    for (const double w : without) spread += (w - centre) * (w - centre);
    error.standard_error = std::sqrt(spread * (groups - 1.0) / groups);
    // Normal noise of variance s2 on an error whose square is q: the square varies by 2 s2^2 + 4 q s2.
    const Eigen::ArrayXd variance = standard_error.cast<double>().square().colwise().mean().transpose();
    const double of_noise = (2.0 * variance.square() + 4.0 * square.max(0.0) * variance).sum();
    if (error.rel_rmse > 0.0)
        error.noise_error = std::sqrt(of_noise) / static_cast<double>(places) / (mean * mean) / (2.0 * error.rel_rmse);
    return error;
}

Verifier::Verifier(const Surface& surface, const std::vector<Vec3>& viewpoints,
                   const VerificationOptions& options)
    : surface_(surface), tolerance_(options.tolerance) {
    constexpr double rays_of_path = 40.0; // shadow rays and connections to three lights included
    for (int t = 0; t < options.trials; ++t) {
        PathTracerOptions tracer;
        tracer.seed = t == 0 ? options.seed : hash64(options.seed, static_cast<std::uint64_t>(t));
        Trial trial = random_trial(surface, viewpoints, options.lights, options.places, tracer.seed);
        if (trial.places.empty()) continue;
        tracer.strategy = PathStrategy::connected;
        tracer.target_error = options.reference_error;
        tracer.max_samples =
            std::max<Index>(tracer.batches, static_cast<Index>(static_cast<double>(options.most_rays)
                                                               / (rays_of_path * options.places * options.trials)));
        references_.push_back(estimate_irradiance(surface, trial.lights, trial.places, tracer));
        trials_.push_back(std::move(trial));
    }
}

VerifiedError Verifier::error_of(const TransferOperator& transfer) const {
    if (trials_.empty()) return {};
    const LightTransport transport(transfer, surface_);
    const Display display(transfer, surface_);
    VerifiedError all;
    std::vector<ErrorPart> of_lights; // those that show
    double certain_squares = 0.0;
    for (std::size_t t = 0; t < trials_.size(); ++t) {
        const Trial& trial = trials_[t];
        const auto lights = static_cast<Index>(trial.lights.size());
        const auto places = static_cast<Index>(trial.places.size());
        all.lights += static_cast<int>(lights);
        bool shows = false; // any light
        for (Index l = 0; l < lights; ++l) {
            const auto of_light = Eigen::seqN(l, places, lights);
            const Eigen::Array3Xf indirect = references_[t].indirect(Eigen::all, of_light);
            if (!(indirect > 0.0f).any()) continue; // a light that shines out of the scene
            const Spotlight& light = trial.lights[static_cast<std::size_t>(l)];
            const Eigen::Array3Xf found =
                display.irradiance(trial.places, transport.indirect(light, nullptr, tolerance_), light);
            const VerifiedError error =
                compare_with_reference(found, indirect, references_[t].standard_error(Eigen::all, of_light));
            of_lights.push_back({error.rel_rmse, error.standard_error});
            shows = true;
            const double of_places = std::sqrt(
                std::max(0.0, std::pow(error.standard_error, 2) - std::pow(error.noise_error, 2)));
            const double certain = std::clamp((error.rel_rmse - of_places) / 0.8, 0.0, error.rel_rmse);
            certain_squares += certain * certain;
            if (of_lights.size() == 1 || error.rel_rmse > all.worst) {
                all.worst = error.rel_rmse;
                all.worst_light = all.lights - static_cast<int>(lights) + static_cast<int>(l);
                all.bias = error.bias;
                all.reference_error = error.reference_error;
            }
        }
        if (shows) all.places += static_cast<int>(places);
    }
    if (of_lights.empty()) return {};
    const auto lit = static_cast<double>(of_lights.size());
    const ErrorPart mean = root_mean_square(of_lights);
    all.rel_rmse = mean.rms;
    all.standard_error = mean.standard_error;
    all.certain = std::sqrt(certain_squares / lit);
    return all;
}

ErrorParts Verifier::parts_of(const TransferOperator& transfer, const ErrorPartsOptions& options) const {
    std::vector<ErrorParts> parts; // of trials in which a light shows
    for (std::size_t t = 0; t < trials_.size(); ++t)
        if ((references_[t].indirect > 0.0f).any())
            parts.push_back(error_parts(surface_, transfer, trials_[t], references_[t], options));
    const auto mean = [&](ErrorPart ErrorParts::*part) {
        std::vector<ErrorPart> of_trials;
        for (const ErrorParts& p : parts) of_trials.push_back(p.*part);
        return root_mean_square(of_trials);
    };
    return {mean(&ErrorParts::senders), mean(&ErrorParts::links), mean(&ErrorParts::receivers)};
}

} // namespace afterglow
