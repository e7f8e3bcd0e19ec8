#pragma once

#include "core/camera.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <string>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace afterglow {

/// Exactly `count` finite numbers separated by commas. Throws UsageError that names the option.
Eigen::VectorXf parse_numbers(const std::string& option, const std::string& text, int count);

/// An option whose value is one finite number that is no more a zero or infinite as a float: 1e-60, 1e39, nan
/// and trailing letters are errors.
CLI::Option* add_number(CLI::App& command, const std::string& option, double& value,
                        const std::string& help);

/// --light-position, --light-direction (both required), --light-cone, --light-intensity. The caller
/// runs light.check() when all is parsed.
void add_light_options(CLI::App& command, Spotlight& light);

/// --camera-position, --camera-target, --camera-up, --camera-fov, --size. The caller runs camera.check(); where
/// the first two are not required, camera_was_given() tells whether they are there.
void add_camera_options(CLI::App& command, Camera& camera, bool required);
/// --size alone.
void add_size_option(CLI::App& command, Camera& camera);
bool camera_was_given(const CLI::App& command);

/// --threads, --quiet, and --seed for what draws random numbers.
struct RunOptions {
    int threads = 0; // 0: all processors
    std::uint64_t seed = 1;
    bool quiet = false;
};
void add_run_options(CLI::App& command, RunOptions& run);
void add_seed_option(CLI::App& command, RunOptions& run);

} // namespace afterglow
