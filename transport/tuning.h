#pragma once

#include "transport/precompute.h"
#include "transport/verification.h"

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

namespace afterglow {

/// What an operator is judged by: three lights and a thousand places, others for each seed and each `time` than
/// anything else has, in about a tenth of the time that the operator took; in small scenes what it takes to say
/// anything. Keeps a reference to the surface.
Verifier fresh_verifier(const Surface& surface, const PrecomputeReport& report, std::uint64_t seed, int time = 0);

struct TuningStep {
    float coarse_scale = 1.0f;           // of PrecomputeOptions
    VerifiedError error;                 // under lights and at places that all steps share
    std::optional<VerifiedError> judged; // under others, see TuningOptions; mostly of the last step alone
    double seconds = 0.0;                // without the judgement
};

struct TuningOptions {
    double target_error = 0.1; // relRMSE as Verifier::error_of has it
    /// Wall-clock time of all that precompute_to_target() does [s], and resident memory of the process
    /// [byte]: a step that is expected to exceed one is not begun, but the first always is.
    double most_seconds = std::numeric_limits<double>::infinity();
    double most_bytes = std::numeric_limits<double>::infinity();
    /// What the result is judged by: the error under lights and at places that no step was chosen by, others
    /// each time that it is asked. A step that meets the target is judged, and where it misses it by more than
    /// a fifth the search goes on; the result is always judged.
    std::function<VerifiedError(const TransferOperator& transfer, const PrecomputeReport& report, int time)> judge = {};
    std::function<void()> begin_step = {};                  // is called before each step
    std::function<void(const TuningStep& step)> end_step = {}; // and after it
};

/// finest: a quarter of the usual spacing, or five steps, did not do; nothing_to_compare: no light of the
/// trial shows up anywhere, and the spacing is the usual one.
enum class TuningEnd { reached, most_seconds, most_bytes, finest, nothing_to_compare };

struct TuningReport {
    std::vector<TuningStep> steps; // from coarse to fine; the last one is the result
    TuningEnd end = TuningEnd::reached;
};

/// Chooses the spacing of the functions by itself: a coarse precomputation is compared with the path
/// tracer under two dozen random lights; error goes about like a power of the spacing, near one, so that
/// the next step's spacing follows; and so on until the target is met. Mostly two steps, of which the
/// first takes a small part of the time. Other lights and places judge how well it went, as the
/// steps were chosen by these. Above 10 %, what is dropped of links follows the target too
/// (link_threshold()).
///
/// options.coarse_radius must be 0, and the operator neumann. With a limit of time the result depends
/// on the machine.
TransferOperator precompute_to_target(const Surface& surface, PrecomputeOptions options,
                                      const TuningOptions& tuning, PrecomputeReport& report,
                                      TuningReport& steps);

} // namespace afterglow
