#pragma once

#include "basis/shepard_basis.h"
#include "transport/transfer_operator.h"

#include <memory>

namespace afterglow {

/// Reads a field over the finest level's points at any surface point: what renderers and queries
/// share. Only one level is evaluated, whatever the number of levels.
class Display {
public:
    /// Keeps references.
    Display(const TransferOperator& transfer, const Surface& surface);

    /// Indirect irradiance [W/m^2] = max(0, n . sum_j B_j(x) V_j); zero and `covered` false where no
    /// function and no close point in sight covers x. `field` as from LightTransport::indirect.
    Rgb irradiance(const SurfacePoint& x, const VectorIrradiance& field, bool& covered) const;

private:
    const TransferOperator& transfer_;
    ShepardBasis basis_;
};

} // namespace afterglow
