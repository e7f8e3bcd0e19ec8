#include "transport/tuning.h"

#include "core/peak_memory.h"
#include "core/sampling.h"
#include "core/seconds.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

namespace afterglow {
namespace {

constexpr float first_scale = 4.0f, finest_scale = 0.25f;
constexpr int most_steps = 5;
// Shares of the target, as errors are known to a tenth: what a step aims at, the second lower as it is far from the
// first, and what fresh lights may say.
constexpr double far_aim = 0.65, aim = 0.8, allowed = 1.2;
constexpr double expected_order = 0.9; // of the error in the spacing
constexpr double cost_order = 1.5; // of time and memory in 1 / spacing, at most, as seen in ten scenes
constexpr double planned_share = 0.8; // of the time that is left: a step's is not known better, and it is judged

/// Of spacings: where a single place decides, less may do than it seems; and a step that costs less than half as
/// much again as the last is not worth it.
constexpr double largest_step = 0.2, smallest_step = 0.75;

/// Rays that a comparison with the path tracer may take.
std::uint64_t verification_rays(const PrecomputeReport& report) {
    return std::max<std::uint64_t>(3'000'000, (report.links.rays + report.points_rays) / 10);
}

/// The order of the error as the last two steps show it.
double order_of(const std::vector<TuningStep>& steps) {
    if (steps.size() < 2) return expected_order;
    const TuningStep &a = steps[steps.size() - 2], &b = steps.back();
    if (!(a.error.certain > 0.0 && b.error.certain > 0.0)) return expected_order; // noise alone
    const double order = std::log(a.error.certain / b.error.certain)
                         / std::log(static_cast<double>(a.coarse_scale / b.coarse_scale));
    return std::clamp(order, 0.5, 1.2);
}

} // namespace

Verifier fresh_verifier(const Surface& surface, const PrecomputeReport& report, std::uint64_t seed, int time) {
    VerificationOptions options;
    options.seed = hash64(seed, 0x7e41f + static_cast<std::uint64_t>(time));
    options.most_rays = verification_rays(report);
    return {surface, report.viewpoints, options};
}

TransferOperator precompute_to_target(const Surface& surface, PrecomputeOptions options,
                                      const TuningOptions& tuning, PrecomputeReport& report,
                                      TuningReport& result) {
    const auto start = std::chrono::steady_clock::now();
    const auto elapsed = [&] { return seconds_since(start); };
    const double memory_before = peak_memory();
    // Smaller thresholds than usual make larger files, but no smaller errors (docs/charts.md).
    options.links.target_error = std::max(LinkOptions().target_error, tuning.target_error);
    options.coarse_scale = first_scale;
    std::optional<TransferOperator> transfer;
    result = {};
    int times_judged = 0;
    const auto judge = [&](TuningStep& step) {
        step.judged = tuning.judge ? tuning.judge(*transfer, report, times_judged++) : VerifiedError();
    };
    for (;;) {
        const double begin = elapsed();
        const int step = static_cast<int>(result.steps.size());
        if (tuning.begin_step) tuning.begin_step();
        report = {};
        transfer.reset(); // two at a time would take twice the memory
        transfer = precompute(surface, options, &report);
        // The same lights and places each time, by ever more paths. Few lights a trial, as a sixth of
        // its places are in sight of each: what is close to a light is the hardest.
        const Verifier verifier(surface, report.viewpoints,
                                {.trials = 8,
                                 .lights = 3,
                                 .places = 250,
                                 .reference_error = 0.5 * tuning.target_error, // its noise is taken out
                                 .most_rays = verification_rays(report),
                                 .tolerance = std::max(LightTransport::usual_tolerance, 0.1 * tuning.target_error),
                                 .seed = hash64(options.seed, 0x7a5e)});
        TuningStep& last = result.steps.emplace_back();
        last.coarse_scale = options.coarse_scale;
        last.error = verifier.error_of(*transfer);
        last.seconds = elapsed() - begin;
        if (tuning.end_step) tuning.end_step(last);
        if (!last.error.any()) { // then the usual spacing
            result.end = TuningEnd::nothing_to_compare;
            if (last.coarse_scale <= 1.0f) break;
            options.coarse_scale = 1.0f;
            continue;
        }
        double error = last.error.certain;
        if (error <= tuning.target_error) {
            judge(last);
            if (last.judged->rel_rmse <= allowed * tuning.target_error) break;
            error = last.judged->certain;
        }
        result.end = TuningEnd::finest;
        if (last.coarse_scale <= finest_scale || step + 1 == most_steps) break;

        const double wanted =
            std::pow((step == 0 ? far_aim : aim) * tuning.target_error / error, 1.0 / order_of(result.steps));
        double scale = last.coarse_scale * std::clamp(wanted, largest_step, smallest_step);
        scale = std::max(scale, static_cast<double>(finest_scale));
        // As fine as the limits let it be, if that is worth a step.
        const double coarsest_worthwhile = smallest_step * last.coarse_scale;
        const double time_left = planned_share * (tuning.most_seconds - elapsed());
        const double of_time =
            last.coarse_scale * std::pow(last.seconds / std::max(1e-9, time_left), 1.0 / cost_order);
        const double of_memory =
            last.coarse_scale
            * std::pow(std::max(1.0, peak_memory() - memory_before) / std::max(1.0, tuning.most_bytes - memory_before),
                       1.0 / cost_order);
        if (std::max(of_time, of_memory) > scale) {
            scale = std::max(of_time, of_memory);
            if (scale > coarsest_worthwhile) {
                result.end = of_time > of_memory ? TuningEnd::most_seconds : TuningEnd::most_bytes;
                break;
            }
        }
        options.coarse_scale = static_cast<float>(scale);
    }
    TuningStep& last = result.steps.back();
    if (!last.judged) judge(last);
    if (last.error.any() && last.error.certain <= tuning.target_error
        && last.judged->rel_rmse <= allowed * tuning.target_error)
        result.end = TuningEnd::reached;
    return std::move(*transfer);
}

} // namespace afterglow
