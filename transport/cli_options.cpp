#include "transport/cli_options.h"

#include "core/error.h"
#include "core/text.h"

#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

namespace afterglow {
namespace {

template <class Number>
bool parse(std::string_view text, Number& value) {
    text = without_plus(text);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc{} && end == text.data() + text.size();
}

CLI::Option* add_vector(CLI::App& command, const std::string& option, Vec3& value,
                        const std::string& help, const std::string& form = "x,y,z") {
    return command
        .add_option_function<std::string>(
            option,
            [option, &value](const std::string& text) { value = parse_numbers(option, text, 3); },
            help)
        ->type_name(form);
}

void parse_size(const std::string& text, Camera& camera) {
    const auto cross = text.find('x');
    const std::string_view view = text;
    if (cross == std::string::npos || !parse(view.substr(0, cross), camera.width)
        || !parse(view.substr(cross + 1), camera.height) || camera.width < 1 || camera.height < 1
        || camera.width > 32768 || camera.height > 32768)
        throw UsageError("--size must be WIDTHxHEIGHT in pixels, each from 1 to 32768, not '" + printable(text)
                         + "'");
}

} // namespace

Eigen::VectorXf parse_numbers(const std::string& option, const std::string& text, int count) {
    Eigen::VectorXf values(count);
    std::string_view rest = text;
    for (int i = 0; i < count; ++i) {
        const auto comma = rest.find(',');
        if ((comma == std::string_view::npos) != (i + 1 == count) || !parse_finite(rest.substr(0, comma), values[i]))
            throw UsageError(option + " must be " + std::to_string(count)
                             + " finite numbers with commas between them, not '" + printable(text) + "'");
        if (comma != std::string_view::npos) rest.remove_prefix(comma + 1);
    }
    return values;
}

CLI::Option* add_number(CLI::App& command, const std::string& option, double& value,
                        const std::string& help) {
    return command
        .add_option_function<std::string>(
            option,
            [option, &value](const std::string& text) {
                if (!parse(text, value) || !std::isfinite(value))
                    throw UsageError(option + " must be a finite number, not '" + printable(text) + "'");
                const double size = std::abs(value);
                if (size > std::numeric_limits<float>::max()
                    || (size > 0.0 && size < std::numeric_limits<float>::min()))
                    throw UsageError(option + " must be 0 or between 1.2e-38 and 3.4e38 in size, not '" + printable(text) + "'");
            },
            help)
        ->type_name("NUMBER");
}

void add_light_options(CLI::App& command, Spotlight& light) {
    add_vector(command, "--light-position", light.position, "Position of the spotlight")
        ->required()
        ->group("Light");
    add_vector(command, "--light-direction", light.direction, "Direction of its axis")
        ->required()
        ->group("Light");
    command
        .add_option_function<std::string>(
            "--light-cone",
            [&light](const std::string& text) {
                const Eigen::VectorXf angles = parse_numbers("--light-cone", text, 2);
                light.inner_angle = angles[0];
                light.outer_angle = angles[1];
            },
            "Half-angles in degrees: full intensity within inner, none beyond outer (default 0,45)")
        ->type_name("inner,outer")
        ->group("Light");
    command
        .add_option_function<std::string>(
            "--light-intensity",
            [&light](const std::string& text) {
                light.intensity = parse_numbers("--light-intensity", text, 3).array();
            },
            "Intensity on the axis in W/sr (default 1,1,1)")
        ->type_name("r,g,b")
        ->group("Light");
}

void add_camera_options(CLI::App& command, Camera& camera, bool required) {
    add_vector(command, "--camera-position", camera.position, "Position of the camera")
        ->required(required)
        ->group("Camera");
    add_vector(command, "--camera-target", camera.target, "Point in the middle of the picture")
        ->required(required)
        ->group("Camera");
    add_vector(command, "--camera-up", camera.up,
               "Direction that is up in the picture (default 0,1,0)")
        ->group("Camera");
    command
        .add_option_function<std::string>(
            "--camera-fov",
            [&camera](const std::string& text) {
                camera.vertical_fov = parse_numbers("--camera-fov", text, 1)[0];
            },
            "Vertical field of view in degrees (default 50)")
        ->type_name("deg")
        ->group("Camera");
    add_size_option(command, camera);
}

void add_size_option(CLI::App& command, Camera& camera) {
    command
        .add_option_function<std::string>(
            "--size", [&camera](const std::string& text) { parse_size(text, camera); },
            "Size of the picture in pixels (default " + std::to_string(camera.width) + "x"
                + std::to_string(camera.height) + ")")
        ->type_name("WxH")
        ->group("Camera");
}

bool camera_was_given(const CLI::App& command) {
    return command.count("--camera-position") > 0 && command.count("--camera-target") > 0;
}

void add_run_options(CLI::App& command, RunOptions& run) {
    command.add_option("--threads", run.threads, "Threads to use (default 0: all processors)")
        ->check(CLI::Range(0, 4096));
    command.add_flag("--quiet", run.quiet, "Nothing on stderr but errors");
}

void add_seed_option(CLI::App& command, RunOptions& run) {
    command
        .add_option_function<std::string>(
            "--seed",
            [&run](const std::string& text) {
                if (!parse(text, run.seed))
                    throw UsageError("--seed must be an integer from 0 to 2^64 - 1, not '" + printable(text)
                                     + "'");
            },
            "Seed of all random numbers (default 1)")
        ->type_name("UINT");
}

} // namespace afterglow
