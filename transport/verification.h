#pragma once

#include "core/surface.h"
#include "transport/path_tracer.h"
#include "transport/spotlight.h"
#include "transport/transfer_operator.h"

#include <cstdint>
#include <string>
#include <vector>

namespace afterglow {

/// Lights and places as a person may choose them, to try an operator on.
struct Trial {
    std::vector<Spotlight> lights;
    std::vector<Vec3> eyes; // two a light: where it is, and another place in the open
    std::vector<SurfacePoint> places; // in sight of the eyes, in no order
};

/// A trial at random: spotlights of 20 to 50 degrees in the open, where the harmonic mean of the
/// distances around is at least half of the typical ray length and six tenths of all directions meet the
/// scene; they shine at what is farthest of four random directions. Places are in sight of these and of
/// as many other places in the open. Empty where hardly anything is in sight. `viewpoints` as from find_viewpoints().
Trial random_trial(const Surface& surface, const std::vector<Vec3>& viewpoints, int lights, int places,
                   std::uint64_t seed);

struct VerificationOptions {
    int trials = 1;    // each with lights and places of its own
    int lights = 3;    // a trial
    int places = 1000; // a trial
    double reference_error = 0.03;        // relative, that the path tracer shall reach
    std::uint64_t most_rays = 10'000'000; // that it takes, about
    double tolerance = LightTransport::usual_tolerance; // of LightTransport::indirect()
    std::uint64_t seed = 1;
};

/// How far an operator is from the path tracer under the lights of a trial.
struct VerifiedError {
    double rel_rmse = 0.0;       // of indirect irradiance: root mean square over the lights of each light's
                                 // relRMSE, the path tracer's own variance taken out
    double standard_error = 0.0; // of rel_rmse, over the choice of places (jackknife of 20 groups)
    double noise_error = 0.0;    // what of standard_error the reference's noise makes; of one light
    double worst = 0.0;          // relRMSE under the light that has the largest
    int worst_light = 0;         // its number, those of the first trial first
    double certain = 0.0;        // as rel_rmse, of each light's relRMSE less what single places make of it:
                                 // all of it where its standard error, less its
                                 // noise_error, is as large; nothing where that is below a fifth
    double bias = 0.0;           // mean error over mean, under that light
    double reference_error = 0.0; // there
    int lights = 0, places = 0; // of all trials
    bool any() const { return places > 0; }
    /// For a person, in one line.
    std::string text() const;
};

struct ErrorParts;
struct ErrorPartsOptions;

/// Trials, and what the path tracer says of them: to try several operators of one scene on.
class Verifier {
public:
    /// Lights and places depend on the seed and the scene alone. Keeps a reference to the surface.
    Verifier(const Surface& surface, const std::vector<Vec3>& viewpoints,
             const VerificationOptions& options);
    /// Those in which anything is in sight.
    const std::vector<Trial>& trials() const { return trials_; }
    /// Nothing (any() is false) where hardly anything is in sight.
    VerifiedError error_of(const TransferOperator& transfer) const;
    /// Mean squares over the trials, of which there must be one. Not of the paper's operator.
    ErrorParts parts_of(const TransferOperator& transfer, const ErrorPartsOptions& options) const;

private:
    const Surface& surface_;
    double tolerance_;
    std::vector<Trial> trials_;
    std::vector<IrradianceEstimate> references_; // a trial each
};

/// The same for one light of a trial, of which the reference is known: 3 x places each [W/m^2].
VerifiedError compare_with_reference(const Eigen::Array3Xf& found, const Eigen::Array3Xf& reference,
                                     const Eigen::Array3Xf& standard_error);

} // namespace afterglow
