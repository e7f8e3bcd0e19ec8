#pragma once

#include "basis/point_hierarchy.h"
#include "basis/push.h"
#include "basis/pyramid.h"
#include "core/surface.h"
#include "transport/direct_light.h"
#include "transport/links.h"
#include "transport/rgb_links.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace afterglow {

inline constexpr int most_bounces = 1000; // that may be asked for by number

enum class OperatorKind {
    neumann, // one bounce, applied again and again
    paper    // the sum of several bounces, stored, as [LZT08] prints it
};

/// As it is called on the command line and in files.
const char* operator_name(OperatorKind kind);

/// All that a transfer file holds: the basis and the operator over it. Senders are the points of the
/// first `sender_levels` levels; receivers are those of the levels that lead to display.
struct TransferOperator {
    OperatorKind kind = OperatorKind::neumann;
    PointHierarchy points;
    int sender_levels = 0;
    PullOperator pull; // of the senders
    int bounces = 0;   // of indirect light, 0: all of them

    PushOperator push; // neumann
    std::vector<float> sender_areas; // neumann: SenderRows::finest_areas()
    Links links;       // neumann: T

    Pyramid pyramid;    // paper: of the senders
    RgbLinks solution;  // paper: S

    std::uint32_t senders() const { return points.end(sender_levels - 1); }
    /// The stored links of the receivers of a level, or of all.
    std::uint64_t link_count(int level) const;
    std::uint64_t link_count() const;
    /// What these take in a file.
    std::uint64_t link_bytes(int level) const;
};

/// Three numbers (R, G, B) a sender point: its radiosity [W/m^2].
using Radiosity = std::vector<float>;
/// Nine numbers a point, component of space times colour: x.R, x.G, x.B, y.R ... [W/m^2]; the
/// irradiance of a surface with normal n is max(0, n . V) per colour. Of the paper's operator they
/// are coefficients, of a field that is the sum over the levels.
using VectorIrradiance = std::vector<float>;

/// n . V at a point of a field, not clamped [W/m^2].
inline Rgb net_irradiance(const VectorIrradiance& field, Index point, const Vec3& n) {
    const float* v = &field[9 * static_cast<std::size_t>(point)];
    Rgb e;
    for (int c = 0; c < 3; ++c) e[c] = n.x() * v[c] + n.y() * v[3 + c] + n.z() * v[6 + c];
    return e;
}

struct NeumannStatistics {
    int products = 0;      // applications of the bounce operator
    double residual = 0.0; // relative to the first bounce
};

/// The operator at work: direct light in, indirect vector irradiance out. Of the paper's operator,
/// indirect() alone is there.
class LightTransport {
public:
    static constexpr double usual_tolerance = 2e-3;

    /// Keeps references to both, which must outlive it.
    LightTransport(const TransferOperator& transfer, const Surface& surface);

    const TransferOperator& transfer() const { return transfer_; }

    /// Radiosity rho E of the senders by direct light: of the finest as DirectLight has it, of the
    /// coarser ones pulled from these.
    Radiosity direct_radiosity(const Spotlight& light) const;

    /// What links are multiplied with: the senders' radiosity pulled, differenced and updated, four
    /// floats a sender (R, G, B, 0).
    std::vector<float> coefficients(const Radiosity& radiosity) const;
    /// The same in place, of four floats a sender.
    void make_coefficients(std::vector<float>& radiosity) const;

    /// One bounce: radiosity of the sender points by light that left them, M f = rho n . push(T e)
    /// with e the coefficients of f.
    Radiosity bounce(const Radiosity& radiosity) const;

    /// The sum of all bounces, (I - M)^-1 f = f + M f + M^2 f + ...: the Neumann series accelerated
    /// by minimal residuals over its Krylov space (GMRES, Saad and Schultz 1986), each colour by
    /// itself; ends when the residual is below `tolerance` times the first bounce.
    Radiosity all_bounces(const Radiosity& direct, double tolerance = usual_tolerance,
                          NeumannStatistics* statistics = nullptr) const;

    /// The first `count` terms of that sum, one product each but the first.
    Radiosity some_bounces(const Radiosity& direct, int count) const;

    /// T e pushed to every receiver: indirect vector irradiance at all points. Linear.
    VectorIrradiance gather(const Radiosity& radiosity) const;

    /// What the senders radiate under a light after as many bounces as the operator says, direct light
    /// included. Not of the paper's operator. `tolerance` as of all_bounces().
    Radiosity radiosity(const Spotlight& light, NeumannStatistics* statistics = nullptr,
                        double tolerance = usual_tolerance) const;

    /// Indirect vector irradiance at all points under a light, after as many bounces as the operator
    /// says. Of `neumann` it is nowhere below zero on the display level (make_positive()).
    VectorIrradiance indirect(const Spotlight& light, NeumannStatistics* statistics = nullptr,
                              double tolerance = usual_tolerance) const;

private:
    const TransferOperator& transfer_;
    const Surface& surface_;
    std::optional<DirectLight> direct_light_; // neumann
    /// T e pushed to the receivers of the first levels, a LinkProduct each.
    std::vector<float> apply_links(const std::vector<float>& coefficients, int levels) const;
    VectorIrradiance apply_paper(const std::vector<float>& direct_irradiance) const;
};

} // namespace afterglow
