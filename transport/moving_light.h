#pragma once

#include "transport/link_columns.h"
#include "transport/positivity.h"
#include "transport/transfer_operator.h"

#include <array>
#include <cstdint>
#include <future>
#include <optional>
#include <vector>

namespace afterglow {

struct MovingLightStatistics {
    double direct_seconds = 0.0, coefficients_seconds = 0.0, links_seconds = 0.0, push_seconds = 0.0;
    int rounds = 0;
    double links_share = 0.0; // links that were multiplied, of all; of all rounds together
    bool anew = false;        // the light had jumped: all was computed from the start
    bool settled = false;     // a further round would change less than the tolerance
    double seconds() const {
        return direct_seconds + coefficients_seconds + links_seconds + push_seconds;
    }
};

/// Indirect light that follows a light which moves: LightTransport::indirect at a fraction of its cost
/// where two poses differ little.
///
/// With e the direct radiosity, M the bounce and T the links, it keeps the coefficients c of the radiosity
/// b = e + M b and the product T c. A *round* computes b anew from the product as it is, and its
/// coefficients; then those that have changed most since they were last multiplied are multiplied, by
/// their columns of T, and the product is corrected. So the light of further bounces is at most a few
/// poses old, and comes to rest with the light: rounds are the Neumann series, from the last pose on.
///
/// The links to each level of receivers are multiplied by themselves: those to coarse levels are many and
/// small. A column of a level's links T_j waits while |change of c_j| |T_j| < tau sqrt(links of T_j), tau = 0.7
/// tolerance |V| / sqrt(all links), V the display level's field, so that all that wait together change its root mean
/// square by less than 0.7 `tolerance` of it. The light has settled when all changes together are below the
/// tolerance, or would be in the next round by what rounds have passed on to the next so far. The display
/// level's links are few, and all multiplied when a pose ends.
class MovingLight {
public:
    struct Options {
        double tolerance = 4e-3;
        int most_rounds = 0; // a pose; 0: until it has settled
    };

    /// Keeps a reference. Links are copied after the first pose, in the background: 4 bytes each; those to the display
    /// level within it, 8 bytes each.
    MovingLight(const LightTransport& transport, const Options& options);

    /// Indirect vector irradiance at all points under the light, until the next call. The same poses in
    /// the same order give the same bits at any number of threads. Of operators without further
    /// columns (the paper's, or with a given number of bounces, or whose senders are displayed) it is
    /// LightTransport::indirect.
    const VectorIrradiance& follow(const Spotlight& light, MovingLightStatistics* statistics = nullptr);

private:
    const LightTransport& transport_;
    Options options_;
    /// The links to the receivers of one level.
    struct Part {
        LinkColumns columns;
        std::vector<float> norm2;   // |T_j|^2, as it counts at the display level
        std::vector<float> applied; // c as it was multiplied, four floats a sender
    };
    std::vector<Part> parts_; // of all levels but the display level; empty before the second pose
    std::future<std::vector<Part>> coming_parts_;
    std::uint64_t links_ = 0;                // of all parts
    struct DisplayLink {
        std::uint32_t sender, bits; // the latter: the step as a float's, then x, y and z, four bits each from the lowest on
    };
    std::vector<std::uint64_t> display_begin_; // of a display point each, and the end; empty before the first pose
    std::vector<DisplayLink> display_links_;
    std::vector<float> coefficients_;        // the newest
    std::vector<Eigen::Vector4f> product_;   // T c: three a receiver, x, y, z; R, G, B, 0 each
    using Padded = std::array<Eigen::Vector4f, 3>; // x, y, z; R, G, B, 0 each
    std::vector<Padded> coarse_;             // the same of the levels before the display level, pushed
    int levels_pushed_ = 0;                  // that hold the product as it is
    VectorIrradiance field_;
    std::optional<PositivityLimiter> limiter_;
    std::vector<std::uint32_t> negative_; // display points whose irradiance is below zero without limiter_
    /// What is still to come when a round has been made, told by what rounds before passed on to the next. All
    /// effects are those of changes on the field, sums of squares.
    class Forecast {
    public:
        void begin_pose() { multiplied2_ = 0.0; }
        /// A round finds changes of this effect.
        void found(double effect2);
        /// It has multiplied all but what waits: the effect of the changes that the next one would find.
        double made(double effect2, double waiting2);

    private:
        double multiplied2_ = 0.0, waiting2_ = 0.0; // by the last round of the pose, after it
        double passed_on_ = 1.0; // the most there was lately, a share of what was multiplied
    };
    Forecast forecast_;
    double field_norm_ = 0.0; // |field| at the display level
    int rounds_without_rest_ = 0; // of this pose, maybe in several calls
    std::optional<Spotlight> light_; // of the last pose

    /// Of the radiosity that the product and direct light make.
    void make_coefficients(const Radiosity& direct);
    struct Changes {
        std::vector<std::vector<LinkColumns::Change>> list; // of each part, those that cannot wait
        std::uint64_t links = 0; // of these
        double effect2 = 0.0;    // of all changes on the field, sum of squares
        double waiting2 = 0.0;   // of those that wait
        /// Sums of new times old coefficients and of old ones squared, each as it counts in the field.
        Eigen::Array4d both = Eigen::Array4d::Zero(), old = Eigen::Array4d::Zero();
    };
    Changes changes() const;
    void apply(const Changes& changes);
    class Stopwatch;
    void follow_round(const Radiosity& direct, MovingLightStatistics& statistics, Stopwatch& watch);
    void start_anew(const Radiosity& direct);
    /// Of a light that changes its intensity alone, all is known.
    void follow_intensity(const Spotlight& light);
    /// Of a light that grows brighter or darker as a whole, most is known; whether something changed.
    bool follow_brightness(const Changes& changes);
    void scale(const Rgb& factor);
    bool follows() const;
    static std::vector<Part> make_parts(const TransferOperator& transfer);
    void await_parts();
    void unpack_display_links();
    void store(Index i, const Padded& value);
    Padded with_prediction(Index i, const Eigen::Vector4f& x, const Eigen::Vector4f& y, const Eigen::Vector4f& z) const;
    template <class Visit>
    void push_levels(int levels, const Visit& visit);
    void push_display();
};

} // namespace afterglow
