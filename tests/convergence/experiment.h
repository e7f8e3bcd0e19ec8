#pragma once

#include "transport/path_tracer.h"
#include "transport/precompute.h"

#include <string>
#include <vector>

namespace afterglow {

/// A scene, its lights, the places where the error is measured, and what the path tracer says
/// there.
struct Experiment {
    std::string name;
    Scene scene;
    Surface surface;
    std::vector<Spotlight> lights;
    std::vector<SurfacePoint> places;
    IrradianceEstimate reference; // column place * lights + light
    double reference_error = 0.0; // relative standard error, root mean square over the lights

    /// `rays`: that look for places from the scene's viewpoint. target_error: of each light's
    /// reference.
    Experiment(const std::string& builtin_name, std::vector<Spotlight> lights_, int rays,
               double target_error);
};

/// How far an operator's indirect irradiance is from the reference: squared errors relative to the
/// square of the mean irradiance of each light, mean over lights and channels, the reference's own
/// variance subtracted. One value a place: their mean is relRMSE^2.
struct SquaredErrors {
    Eigen::ArrayXd of_place;

    double mean() const { return of_place.mean(); }
    double standard_error() const; // of the mean, by the choice of the places
    double root() const;           // relRMSE; 0 where noise makes the mean negative
    double root_error() const;     // its standard error
};

/// Indirect irradiance at the places by an operator; columns as in the reference. bounces < 0: all
/// of them; else the operator is applied to direct light and as many bounces of it.
Eigen::Array3Xf indirect_irradiance(const Experiment& experiment, const TransferOperator& transfer,
                                    int bounces = -1);

SquaredErrors measure_errors(const Experiment& experiment, const Eigen::Array3Xf& indirect);

/// Root mean square difference between two operators' irradiance, relative to the mean of each
/// light.
double distance(const Experiment& experiment, const Eigen::Array3Xf& a, const Eigen::Array3Xf& b);

} // namespace afterglow
