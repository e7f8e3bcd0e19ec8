#include "transport/mean_estimator.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace afterglow {
namespace {

/// The sums of all batches of all items, extended by rounds.
class BatchSums {
public:
    BatchSums(Index items, Index outputs, int batches, std::uint64_t seed)
        : items_(items), outputs_(outputs), batches_(batches), seed_(seed),
          sums_(static_cast<std::size_t>(items * outputs * batches), Eigen::Array3d::Zero()),
          counts_(static_cast<std::size_t>(items), 0) {}

    /// Extends each batch of item i to wanted(i) samples.
    template <class Wanted>
    void extend(const Sampler& sampler, const Wanted& wanted,
                const std::function<void(double)>& progress) {
        std::atomic<Index> done{0};
        rays_ += parallel_sum(
            items_, std::uint64_t{0},
            [&](Index item) {
                Index& count = counts_[static_cast<std::size_t>(item)];
                const Index more = wanted(item) - count;
                std::uint64_t rays = 0;
                for (int b = 0; b < batches_ && more > 0; ++b)
                    rays += sampler(item,
                                    hash64(seed_, static_cast<std::uint64_t>(item * batches_ + b)),
                                    count, more, batch(item, b));
                count += std::max<Index>(more, 0);
                const Index finished = ++done;
                if (progress && finished % std::max<Index>(1, items_ / 200) == 0)
                    progress(static_cast<double>(finished) / static_cast<double>(items_));
                return rays;
            },
            std::clamp<Index>(items_ / 256, 1, 256));
    }

    MeanEstimate estimate() const {
        MeanEstimate result;
        result.mean.setZero(3, items_ * outputs_);
        result.standard_error.setZero(3, items_ * outputs_);
        result.rays = rays_;
        std::vector<double> mean(static_cast<std::size_t>(outputs_)), variance(mean);
        for (Index i = 0; i < items_; ++i) {
            const auto count = static_cast<double>(counts_[static_cast<std::size_t>(i)]);
            if (count == 0.0) continue;
            result.samples +=
                static_cast<std::uint64_t>(count) * static_cast<std::uint64_t>(batches_);
            for (Index o = 0; o < outputs_; ++o) {
                Eigen::Array3d m = Eigen::Array3d::Zero(), v = Eigen::Array3d::Zero();
                for (int b = 0; b < batches_; ++b)
                    m += batch(i, b)[o] / count;
                m /= batches_;
                for (int b = 0; b < batches_; ++b)
                    v += (batch(i, b)[o] / count - m).square();
                v /= batches_ * (batches_ - 1.0); // the variance of the mean of the batches
                result.mean.col(i * outputs_ + o) = m.cast<float>();
                result.standard_error.col(i * outputs_ + o) = v.sqrt().cast<float>();
                mean[static_cast<std::size_t>(o)] += m.mean();
                variance[static_cast<std::size_t>(o)] += v.mean();
            }
        }
        for (std::size_t o = 0; o < mean.size(); ++o)
            result.relative_error.push_back(
                mean[o] > 0.0 ? std::sqrt(variance[o] * static_cast<double>(items_)) / mean[o]
                              : 0.0);
        return result;
    }

private:
    std::span<Eigen::Array3d> batch(Index item, int b) {
        return std::span(sums_).subspan(static_cast<std::size_t>((item * batches_ + b) * outputs_),
                                        static_cast<std::size_t>(outputs_));
    }
    std::span<const Eigen::Array3d> batch(Index item, int b) const {
        return std::span(sums_).subspan(static_cast<std::size_t>((item * batches_ + b) * outputs_),
                                        static_cast<std::size_t>(outputs_));
    }

    Index items_, outputs_;
    int batches_;
    std::uint64_t seed_;
    std::vector<Eigen::Array3d> sums_; // [item][batch][output]
    std::vector<Index> counts_;        // of samples in each batch of an item
    std::uint64_t rays_ = 0;
};

/// Whether there is an output of which nothing was found.
bool has_dark_output(const MeanEstimate& estimate, Index items, Index outputs) {
    for (Index o = 0; o < outputs && items > 0; ++o)
        if ((estimate.mean(Eigen::all, Eigen::seq(o, Eigen::last, outputs)) == 0.0f).all()) return true;
    return false;
}

double worst(const std::vector<double>& errors) {
    return errors.empty() ? 0.0 : *std::max_element(errors.begin(), errors.end());
}

/// Standard deviation of each item over all outputs, each output relative to its own mean; divided
/// by its mean over the items. A share of the mean is the least that an item gets: a pilot that
/// never met a rare bright path is no proof that there is none.
std::vector<double> shares(const MeanEstimate& pilot, Index items, Index outputs) {
    constexpr double least_share = 0.35;
    std::vector<double> output_mean(static_cast<std::size_t>(outputs), 0.0);
    for (Index k = 0; k < items * outputs; ++k)
        output_mean[static_cast<std::size_t>(k % outputs)] += pilot.mean.col(k).mean();

    std::vector<double> deviation(static_cast<std::size_t>(items), 0.0);
    double sum = 0.0;
    for (Index k = 0; k < items * outputs; ++k) {
        const double m = output_mean[static_cast<std::size_t>(k % outputs)];
        if (m > 0.0)
            deviation[static_cast<std::size_t>(k / outputs)] +=
                (pilot.standard_error.col(k).cast<double>() / m).square().mean();
    }
    for (double& d : deviation)
        sum += d = std::sqrt(d);
    if (!(sum > 0.0)) return std::vector<double>(deviation.size(), 1.0);
    const double mean = sum / static_cast<double>(items);
    sum = 0.0;
    for (double& d : deviation)
        sum += d = std::max(d / mean, least_share);
    for (double& d : deviation)
        d *= static_cast<double>(items) / sum;
    return deviation;
}

} // namespace

MeanEstimate estimate_means(Index items, Index outputs, const Sampler& sampler,
                            const EstimatorOptions& options) {
    const auto progress = [&](double from, double to) -> std::function<void(double)> {
        if (!options.progress) return nullptr;
        return [&options, from, to](double share) { options.progress(from + (to - from) * share); };
    };
    if (!(options.target_error > 0.0)) {
        const int batches =
            static_cast<int>(std::clamp<Index>(options.samples, 2, std::max(2, options.batches)));
        const Index wanted = (options.samples + batches - 1) / batches;
        BatchSums sums(items, outputs, batches, hash64(options.seed, 1));
        sums.extend(
            sampler, [&](Index) { return wanted; }, progress(0.0, 1.0));
        return sums.estimate();
    }

    constexpr double enough_for_darkness = 1 << 20; // samples in all
    constexpr int pilot_batches = 8;
    constexpr Index pilot_samples = 16; // a batch
    const MeanEstimate first = [&] {
        BatchSums pilot(items, outputs, pilot_batches, hash64(options.seed, 2));
        pilot.extend(
            sampler, [](Index) { return pilot_samples; }, nullptr);
        return pilot.estimate();
    }();
    const std::vector<double> share = shares(first, items, outputs);

    const int batches = std::max(2, options.batches);
    BatchSums sums(items, outputs, batches, hash64(options.seed, 1));
    MeanEstimate result;
    result.relative_error = first.relative_error;
    // The first round is meant to fall short: the pilot's error is a rough guess.
    double samples = 0.3 * pilot_batches * pilot_samples
                     * std::pow(worst(result.relative_error) / options.target_error, 2.0);
    samples = std::min(std::max(samples, 4.0 * batches), static_cast<double>(options.max_samples));
    double reached = 0.0; // share of the work, as far as it can be told
    for (;;) {
        const double expected = std::max(
            reached,
            std::min(1.0, samples / pilot_batches / pilot_samples
                              * std::pow(options.target_error / worst(first.relative_error), 2.0)));
        sums.extend(
            sampler,
            [&](Index item) {
                return static_cast<Index>(
                    std::ceil(samples * share[static_cast<std::size_t>(item)] / batches));
            },
            progress(reached, expected));
        reached = expected;
        result = sums.estimate();
        if (samples >= static_cast<double>(options.max_samples)) break;
        double ratio = worst(result.relative_error) / options.target_error;
        if (samples * static_cast<double>(items) < enough_for_darkness && has_dark_output(result, items, outputs))
            ratio = std::max(ratio, 2.0); // so few may all have missed
        if (ratio <= 1.0) break;
        samples = std::min(samples * std::clamp(1.05 * ratio * ratio, 1.1, 4.0),
                           static_cast<double>(options.max_samples));
    }
    result.samples += first.samples;
    result.rays += first.rays;
    return result;
}

} // namespace afterglow
