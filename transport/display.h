#pragma once

#include "basis/shepard_basis.h"
#include "transport/transfer_operator.h"

#include <span>

namespace afterglow {

/// Reads a field at any surface point: what renderers and queries share. One level is evaluated,
/// the last, whatever the number of levels; of the paper's operator all are [LZT08, eq. (6)].
class Display {
public:
    /// Keeps references.
    Display(const TransferOperator& transfer, const Surface& surface);

    /// Indirect irradiance [W/m^2] = max(0, n . sum_j B_j(x) V_j); zero and `covered` false where no
    /// function covers x (and, but of the paper's operator, no close point is in sight). `field` as
    /// from LightTransport::indirect.
    Rgb irradiance(const SurfacePoint& x, const VectorIrradiance& field, bool& covered) const {
        return net_irradiance(x, x.normal, field, covered).max(0.0f);
    }
    /// The same with another normal, as a picture shows it (Surface::shown_normal); x.normal still
    /// chooses the functions.
    Rgb irradiance(const SurfacePoint& x, const Vec3& shown, const VectorIrradiance& field,
                   bool& covered) const {
        return net_irradiance(x, shown, field, covered).max(0.0f);
    }
    /// Before it is clamped at zero.
    Rgb net_irradiance(const SurfacePoint& x, const VectorIrradiance& field, bool& covered) const {
        return net_irradiance(x, x.normal, field, covered);
    }
    /// At many places at a time, 3 x places; how many are not covered, if that is asked for.
    Eigen::Array3Xf irradiance(std::span<const SurfacePoint> places, const VectorIrradiance& field,
                               Index* uncovered = nullptr) const;

private:
    const TransferOperator& transfer_;
    ShepardBasis basis_;
    Rgb net_irradiance(const SurfacePoint& x, const Vec3& normal, const VectorIrradiance& field,
                       bool& covered) const;
};

} // namespace afterglow
