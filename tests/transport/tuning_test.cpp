#include "transport/tuning.h"

#include "core/builtin_scenes.h"
#include "core/parallel.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace afterglow {
namespace {

struct Tuned {
    Scene scene;
    Surface surface{scene};
    PrecomputeReport report;
    TuningReport tuning;
    TransferOperator transfer;

    explicit Tuned(const TuningOptions& options, const char* name = "builtin:cornell")
        : scene(make_builtin_scene(name)), transfer(precompute_to_target(surface, PrecomputeOptions(), options, report, tuning)) {}
    const TuningStep& last() const { return tuning.steps.back(); }
};

TEST(Tuning, StopsWhereTheTargetIsMet) {
    const Tuned coarse({.target_error = 0.3}), fine({.target_error = 0.06});
    for (const auto& [tuned, target] : {std::pair(&coarse, 0.3), std::pair(&fine, 0.06)}) {
        EXPECT_EQ(tuned->tuning.end, TuningEnd::reached);
        EXPECT_LE(tuned->last().error.rel_rmse, target);
        for (std::size_t k = 1; k < tuned->tuning.steps.size(); ++k) {
            const TuningStep &before = tuned->tuning.steps[k - 1], &after = tuned->tuning.steps[k];
            EXPECT_LT(after.coarse_scale, before.coarse_scale);
            EXPECT_GT(before.error.certain, 0.9 * target);
        }
    }
    EXPECT_LT(coarse.transfer.points.size(), fine.transfer.points.size());
    EXPECT_GT(coarse.last().error.rel_rmse, fine.last().error.rel_rmse);
    EXPECT_GT(fine.tuning.steps.size(), 1u);

    // And with lights and places that the tuning did not see.
    const Verifier fresh(fine.surface, fine.report.viewpoints, {.reference_error = 0.02, .seed = 99});
    const VerifiedError error = fresh.error_of(fine.transfer);
    EXPECT_LE(error.rel_rmse - 2.0 * error.standard_error, 1.2 * 0.06);
}

TEST(Tuning, ChoosesTheSameAtAnyNumberOfThreads) {
    const auto steps = [](int threads) {
        const ThreadLimit limit(threads);
        return Tuned({.target_error = 0.12}).tuning.steps;
    };
    const auto one = steps(1), two = steps(2);
    ASSERT_EQ(one.size(), two.size());
    for (std::size_t k = 0; k < one.size(); ++k) {
        EXPECT_EQ(one[k].coarse_scale, two[k].coarse_scale);
        EXPECT_EQ(one[k].error.rel_rmse, two[k].error.rel_rmse);
    }
}

TEST(Tuning, GivesTheBestItHasWithinItsLimits) {
    const Tuned hurried({.target_error = 0.001, .most_seconds = 1e-3});
    EXPECT_EQ(hurried.tuning.steps.size(), 1u);
    EXPECT_EQ(hurried.tuning.end, TuningEnd::most_seconds);
    EXPECT_GT(hurried.transfer.points.size(), 0u);

    const Tuned narrow({.target_error = 0.001, .most_bytes = 1e6});
    EXPECT_EQ(narrow.tuning.steps.size(), 1u);
    EXPECT_EQ(narrow.tuning.end, TuningEnd::most_bytes);

    // A limit that leaves room is used, however fast the machine is.
    const Tuned limited({.target_error = 0.001, .most_seconds = 10.0 * hurried.last().seconds});
    EXPECT_GT(limited.tuning.steps.size(), 1u);
    EXPECT_EQ(limited.tuning.end, TuningEnd::most_seconds);
    EXPECT_LT(limited.last().coarse_scale, hurried.last().coarse_scale);
}

VerifiedError judgement(double rel_rmse) {
    VerifiedError error;
    error.rel_rmse = error.certain = rel_rmse;
    error.places = 1;
    return error;
}

TEST(Tuning, GoesOnWhereItsJudgeFindsMoreError) {
    std::vector<int> times;
    const Tuned severe({.target_error = 0.4, .judge = [&](const TransferOperator&, const PrecomputeReport&, int time) {
                            times.push_back(time);
                            return judgement(time == 0 ? 0.9 : 0.1);
                        }});
    EXPECT_EQ(times, (std::vector<int>{0, 1}));
    EXPECT_EQ(severe.tuning.end, TuningEnd::reached);
    ASSERT_EQ(severe.tuning.steps.size(), 2u);
    EXPECT_LT(severe.last().coarse_scale, severe.tuning.steps.front().coarse_scale);
    EXPECT_EQ(severe.tuning.steps.front().judged->rel_rmse, 0.9);
    EXPECT_EQ(severe.last().judged->rel_rmse, 0.1);

    // A fifth above the target is as good as such a judgement can tell.
    const Tuned lenient({.target_error = 0.4, .judge = [](const auto&...) { return judgement(0.47); }});
    EXPECT_EQ(lenient.tuning.steps.size(), 1u);
    EXPECT_EQ(lenient.tuning.end, TuningEnd::reached);

    // Where there is no time to go on, the judgement stands, and the target is not called reached.
    const Tuned hurried({.target_error = 0.4, .most_seconds = 1e-3, .judge = [](const auto&...) { return judgement(0.9); }});
    EXPECT_EQ(hurried.tuning.steps.size(), 1u);
    EXPECT_EQ(hurried.tuning.end, TuningEnd::most_seconds);
    EXPECT_EQ(hurried.last().judged->rel_rmse, 0.9);
}

TEST(Tuning, TakesTheUsualSpacingWhereThereIsNothingToCompare) {
    const Tuned black({.target_error = 0.1}, "builtin:furnace:0");
    EXPECT_EQ(black.tuning.end, TuningEnd::nothing_to_compare);
    EXPECT_EQ(black.last().coarse_scale, 1.0f);
}

} // namespace
} // namespace afterglow
