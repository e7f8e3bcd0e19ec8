#include "core/progress.h"

#include <gtest/gtest.h>

namespace afterglow {
namespace {

TEST(Progress, DurationsAreReadInTwoUnitsAtMost) {
    EXPECT_EQ(duration_text(-1.0), "0 s");
    EXPECT_EQ(duration_text(59.4), "59 s");
    EXPECT_EQ(duration_text(59.6), "1 min 00 s");
    EXPECT_EQ(duration_text(185.0), "3 min 05 s");
    EXPECT_EQ(duration_text(7620.0), "2 h 07 min");
}

TEST(Progress, IsSilentWhereItIsNotWantedOrThereIsNoTerminal) {
    testing::internal::CaptureStderr();
    {
        Progress unwanted("a", false), captured("b", true);
        for (Progress* progress : {&unwanted, &captured})
            for (const double share : {0.1, 0.5, 1.0})
                progress->update(share);
    }
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

} // namespace
} // namespace afterglow
