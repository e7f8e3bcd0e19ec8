#pragma once

#include "basis/shepard_basis.h"
#include "transport/spotlight.h"
#include "transport/transfer_operator.h"

#include <span>

namespace afterglow {

/// Reads a field at any surface point: what renderers and queries share. One level is evaluated,
/// the last, whatever the number of levels; of the paper's operator all are [LZT08, eq. (6)].
class Display {
public:
    /// Keeps references.
    Display(const TransferOperator& transfer, const Surface& surface);

    /// Indirect irradiance [W/m^2] = max(0, n . sum_j B_j(x) V_j), `field` as from
    /// LightTransport::indirect(light); zero and `covered` false where no function covers x (and, but
    /// of the paper's operator, no close point is in sight). `shown`: the normal that a picture shows
    /// (Surface::shown_normal), with which irradiance is taken; x.normal chooses the functions.
    ///
    /// In a gap (ShepardBasis::in_gap) light changes over the gap's width and no function speaks for
    /// it: there a gather of `gap_paths` paths takes the functions' place. A path collects direct
    /// light and goes on until nothing stands close above it, where the function closest in sight
    /// tells the rest: 2 to 4 us
    /// a path. Without paths the functions speak there too.
    Rgb irradiance(const SurfacePoint& x, const Vec3& shown, const VectorIrradiance& field,
                   const Spotlight& light, bool& covered, int gap_paths = 1024) const;
    /// At many places at a time, 3 x places; how many are not covered, if that is asked for.
    Eigen::Array3Xf irradiance(std::span<const SurfacePoint> places, const VectorIrradiance& field,
                               const Spotlight& light, Index* uncovered = nullptr) const;
    /// Of the functions alone, before it is clamped at zero.
    Rgb net_irradiance(const SurfacePoint& x, const VectorIrradiance& field, bool& covered) const {
        return net_irradiance(x, x.normal, field, covered);
    }

private:
    const TransferOperator& transfer_;
    const Surface& surface_;
    ShepardBasis basis_;
    Rgb gather(const SurfacePoint& x, const Vec3& shown, const VectorIrradiance& field,
               const Spotlight& light, int paths) const;
    Rgb net_irradiance(const SurfacePoint& x, const Vec3& normal, const VectorIrradiance& field,
                       bool& covered) const;
};

} // namespace afterglow
