#include "core/error.h"
#include "tests/convergence/experiment.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

// How the error of indirect irradiance falls, setting by setting, towards the floor that the other
// settings leave. Each curve becomes a CSV file; the exit status tells whether all fell as they
// should.

namespace afterglow {
namespace {

struct Curve {
    std::string setting;
    std::vector<double> value;
    std::vector<Eigen::Array3Xf> indirect;
    std::vector<SquaredErrors> errors; // against the path tracer
    std::vector<double> to_last;       // distance to the curve's last operator

    void finish(const Experiment& experiment) {
        for (const Eigen::Array3Xf& e : indirect) {
            errors.push_back(measure_errors(experiment, e));
            to_last.push_back(distance(experiment, e, indirect.back()));
        }
    }
};

class Checks {
public:
    void expect(bool holds, const std::string& what) {
        std::printf("  %s %s\n", holds ? "ok  " : "FAIL", what.c_str());
        failed_ += !holds;
    }
    int failed() const { return failed_; }

private:
    int failed_ = 0;
};

/// The settings that all curves start from: small enough to be made thirty times.
PrecomputeOptions base_options(const Experiment& experiment) {
    PrecomputeOptions options;
    options.coarse_radius = experiment.name == "cornell" ? 0.1f : 0.9f;
    options.viewpoint = experiment.scene.viewpoint;
    options.receiver_levels = 4;
    options.sender_levels = 3;
    options.links.rays = 256;
    options.links.threshold = 8e-3f;
    return options;
}

Curve measure_curve(const Experiment& experiment, const std::string& setting,
                    const std::vector<double>& values,
                    const std::function<void(PrecomputeOptions&, double)>& set) {
    Curve curve{setting, values, {}, {}, {}};
    for (const double value : values) {
        PrecomputeOptions options = base_options(experiment);
        set(options, value);
        const TransferOperator transfer = precompute(experiment.surface, options);
        curve.indirect.push_back(indirect_irradiance(experiment, transfer));
    }
    curve.finish(experiment);
    return curve;
}

Curve measure_bounces(const Experiment& experiment, const std::vector<double>& bounces) {
    Curve curve{"bounces", bounces, {}, {}, {}};
    PrecomputeOptions options = base_options(experiment);
    options.links.rays = 2048; // what the last bounces add would else be less than the noise is off
    const TransferOperator transfer = precompute(experiment.surface, options);
    for (const double k : bounces)
        curve.indirect.push_back(indirect_irradiance(experiment, transfer, static_cast<int>(k)));
    curve.finish(experiment);
    return curve;
}

/// Prints the curve and writes FOLDER/SCENE-SETTING.csv. A bounce count of -1 stands for all.
void report(const Experiment& experiment, const Curve& curve, const std::string& folder) {
    std::printf("%s, %s:\n", experiment.name.c_str(), curve.setting.c_str());
    const std::string path = folder + "/" + experiment.name + "-" + curve.setting + ".csv";
    std::ofstream file(path);
    file << curve.setting << ",rel_rmse,standard_error,distance_to_last,reference_error\n";
    for (std::size_t k = 0; k < curve.value.size(); ++k) {
        const SquaredErrors& e = curve.errors[k];
        std::printf("  %8g  %6.2f %% +- %.2f  to the last %6.2f %%\n", curve.value[k],
                    100.0 * e.root(), 100.0 * e.root_error(), 100.0 * curve.to_last[k]);
        file << curve.value[k] << ',' << e.root() << ',' << e.root_error() << ','
             << curve.to_last[k] << ',' << experiment.reference_error << '\n';
    }
    if (!file.flush()) throw FileError(path, "cannot be written");
    std::fflush(stdout);
}

/// Each step may rise by three standard errors of the difference, measured place by place: what two
/// operators have in common (reference, direct light) cancels. What the last operator of the curve
/// has not reached by the one before it must be `least_factor` smaller than it was at first: the
/// setting converges, also where the error is all the floor of the other settings.
void expect_fall(const Curve& curve, double least_factor, Checks& checks) {
    for (std::size_t k = 0; k + 1 < curve.errors.size(); ++k) {
        const SquaredErrors step{curve.errors[k + 1].of_place - curve.errors[k].of_place};
        checks.expect(step.mean() < 3.0 * step.standard_error(),
                      curve.setting + ": error does not rise from " + std::to_string(curve.value[k])
                          + " to " + std::to_string(curve.value[k + 1]));
    }
    const double factor = curve.to_last.front() / curve.to_last[curve.to_last.size() - 2];
    checks.expect(factor > least_factor, curve.setting + ": converges by a factor of "
                                             + std::to_string(factor) + ", at least "
                                             + std::to_string(least_factor));
}

/// Slope of log(noise) against log(rays) by least squares; the last operator of the curve, of far
/// more rays, is the floor from which noise is measured.
double noise_slope(const Curve& curve) {
    double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
    for (std::size_t k = 0; k + 1 < curve.value.size(); ++k) {
        const double x = std::log(curve.value[k]), y = std::log(curve.to_last[k]);
        n += 1.0, sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

void run(const Experiment& experiment, const std::string& folder, Checks& checks) {
    std::printf("%s: %zu places, reference error %.2f %%\n", experiment.name.c_str(),
                experiment.places.size(), 100.0 * experiment.reference_error);

    // Nothing dropped where noise is what is measured, or what is left: a threshold that keeps rare
    // large hits and drops the many misses makes bias of noise, which falls its own way.
    const Curve rays = measure_curve(experiment, "rays", {64, 128, 256, 512, 1024, 8192},
                                     [](PrecomputeOptions& o, double n) {
                                         o.receiver_levels = 3;
                                         o.sender_levels = 2;
                                         o.links.rays = static_cast<int>(n);
                                         o.links.threshold = 0.0f;
                                     });
    report(experiment, rays, folder);
    expect_fall(rays, 4.0, checks);
    const double slope = noise_slope(rays);
    checks.expect(slope > -1.0 && slope < -0.5,
                  "rays: noise falls like N^" + std::to_string(slope) + ", between -1 and -0.5");

    const Curve receivers = measure_curve(experiment, "receiver_levels", {2, 3, 4, 5},
                                          [](PrecomputeOptions& o, double n) {
                                              o.receiver_levels = static_cast<int>(n);
                                              o.links.threshold = 0.0f;
                                          });
    report(experiment, receivers, folder);
    expect_fall(receivers, 1.5, checks);

    const Curve senders =
        measure_curve(experiment, "sender_levels", {1, 2, 3}, [](PrecomputeOptions& o, double n) {
            o.sender_levels = static_cast<int>(n);
        });
    report(experiment, senders, folder);
    expect_fall(senders, 1.5, checks);

    // With more rays: links that small thresholds keep would else be noise.
    const Curve threshold =
        measure_curve(experiment, "threshold", {0.32, 0.16, 0.08, 0.04, 0.02, 0.01},
                      [](PrecomputeOptions& o, double t) {
                          o.links.rays = 2048;
                          o.links.threshold = static_cast<float>(t);
                      });
    report(experiment, threshold, folder);
    expect_fall(threshold, 3.0, checks);

    const Curve bounces = measure_bounces(experiment, {0, 1, 2, 3, 4, 6, 8, 12, -1});
    report(experiment, bounces, folder);
    expect_fall(bounces, 20.0, checks);
}

Spotlight spot(const Vec3& position, const Vec3& direction, float angle) {
    return {.position = position,
            .direction = direction,
            .inner_angle = angle - 10.0f,
            .outer_angle = angle};
}

} // namespace
} // namespace afterglow

int main(int argc, char** argv) {
    using namespace afterglow;
    if (argc > 2 || (argc == 2 && argv[1][0] == '-')) {
        std::fprintf(stderr, "usage: afterglow_convergence [FOLDER]\n");
        return 2;
    }
    const std::string folder = argc > 1 ? argv[1] : AFTERGLOW_CONVERGENCE_FOLDER;
    try {
        std::filesystem::create_directories(folder);
        Checks checks;
        run(Experiment("builtin:cornell",
                       {spot(Vec3(0.278f, 0.54f, 0.28f), -Vec3::UnitY(), 50.0f),
                        spot(Vec3(0.1f, 0.3f, 0.1f), Vec3(1.0f, 0.1f, 0.6f), 35.0f),
                        spot(Vec3(0.4f, 0.45f, 0.1f), Vec3(-0.6f, -0.5f, 0.8f), 30.0f)},
                       700, 0.015),
            folder, checks);
        run(Experiment("builtin:two_rooms",
                       {spot(Vec3(2.0f, 2.6f, 2.0f), -Vec3::UnitY(), 55.0f),
                        spot(Vec3(1.0f, 1.5f, 1.0f), Vec3(1.0f, -0.3f, 0.5f), 40.0f)},
                       400, 0.015),
            folder, checks);
        return checks.failed() == 0 ? 0 : 1;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "afterglow_convergence: %s\n", error.what());
        return 1;
    }
}
