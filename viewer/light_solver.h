#pragma once

#include "transport/display_field.h"
#include "transport/flattening.h"
#include "transport/moving_light.h"
#include "transport/transfer_scene.h"

#include <memory>
#include <optional>

namespace afterglow {

/// From a light's pose to the field that pixels read, whatever operator a file holds.
class LightSolver {
public:
    /// Keeps a reference. `most_rounds`: see MovingLight.
    LightSolver(const TransferScene& scene, int most_rounds);

    /// Indirect light of the pose.
    std::shared_ptr<const DisplayField> solve(const Spotlight& light);
    const MovingLightStatistics& statistics() const { return statistics_; } // of the last pose

private:
    MovingLight light_;
    std::optional<Flattening> flattening_; // of the paper's operator
    DisplayField dark_; // to be copied
    MovingLightStatistics statistics_;
};

} // namespace afterglow
