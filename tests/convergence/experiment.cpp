#include "tests/convergence/experiment.h"

#include "core/builtin_scenes.h"
#include "core/parallel.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"

#include <cmath>

namespace afterglow {

Experiment::Experiment(const std::string& builtin_name, std::vector<Spotlight> lights_, int rays,
                       double target_error)
    : name(builtin_name.substr(builtin_name.find(':') + 1)),
      scene(make_builtin_scene(builtin_name)), surface(scene), lights(std::move(lights_)),
      places(points_in_sight(surface, *scene.viewpoint, rays, 1)) {
    for (Spotlight& light : lights)
        light.check();
    PathTracerOptions options;
    options.target_error = target_error;
    options.seed = 17;
    options.strategy = PathStrategy::connected;
    reference = estimate_irradiance(surface, lights, places, options);
    for (const double e : reference.relative_error)
        reference_error += e * e / static_cast<double>(lights.size());
    reference_error = std::sqrt(reference_error);
}

double SquaredErrors::standard_error() const {
    const double n = static_cast<double>(of_place.size());
    return std::sqrt((of_place - of_place.mean()).square().sum() / (n * (n - 1.0)));
}

double SquaredErrors::root() const {
    return std::sqrt(std::max(0.0, mean()));
}

double SquaredErrors::root_error() const {
    return standard_error() / (2.0 * std::max(root(), 1e-9));
}

Eigen::Array3Xf indirect_irradiance(const Experiment& experiment, const TransferOperator& transfer,
                                    int bounces) {
    const LightTransport transport(transfer, experiment.surface);
    const Display display(transfer, experiment.surface);
    const auto count = static_cast<Index>(experiment.places.size());
    const auto lights = static_cast<Index>(experiment.lights.size());
    Eigen::Array3Xf indirect(3, count * lights);
    for (Index l = 0; l < lights; ++l) {
        const Radiosity direct = transport.direct_radiosity(experiment.lights[l]);
        Radiosity sum = direct;
        if (bounces < 0) {
            sum = transport.all_bounces(direct);
        } else {
            Radiosity bounce = direct;
            for (int k = 0; k < bounces; ++k) {
                bounce = transport.bounce(bounce);
                for (std::size_t i = 0; i < sum.size(); ++i)
                    sum[i] += bounce[i];
            }
        }
        const VectorIrradiance field = transport.gather(sum);
        parallel_for(count, [&](Index p) {
            bool covered = false;
            indirect.col(p * lights + l) = display.net_irradiance(experiment.places[p], field, covered).max(0.0f);
        });
    }
    return indirect;
}

namespace {

/// Mean over places of squares (3 x columns), each light in units of its mean irradiance squared.
Eigen::ArrayXd in_units_of_light(const Experiment& experiment, const Eigen::Array3Xf& squares) {
    const auto count = static_cast<Index>(experiment.places.size());
    const auto lights = static_cast<Index>(experiment.lights.size());
    Eigen::ArrayXd of_place = Eigen::ArrayXd::Zero(count);
    for (Index l = 0; l < lights; ++l) {
        double mean = 0.0;
        for (Index p = 0; p < count; ++p)
            mean += experiment.reference.indirect.col(p * lights + l).mean();
        mean /= static_cast<double>(count);
        for (Index p = 0; p < count; ++p)
            of_place[p] +=
                squares.col(p * lights + l).mean() / (mean * mean * static_cast<double>(lights));
    }
    return of_place;
}

} // namespace

SquaredErrors measure_errors(const Experiment& experiment, const Eigen::Array3Xf& indirect) {
    const IrradianceEstimate& reference = experiment.reference;
    return {in_units_of_light(experiment, (indirect - reference.indirect).square()
                                              - reference.standard_error.square())};
}

double distance(const Experiment& experiment, const Eigen::Array3Xf& a, const Eigen::Array3Xf& b) {
    return std::sqrt(in_units_of_light(experiment, (a - b).square()).mean());
}

} // namespace afterglow
