#include "tests/fuzz/harness.h"
#include "transport/cli_options.h"

#include <CLI/CLI.hpp>

#include <vector>

// A command line, one argument a line, of the options that take numbers.

using namespace afterglow;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::vector<std::string> arguments;
    std::string_view rest(reinterpret_cast<const char*>(data), size);
    while (!rest.empty()) {
        const std::size_t length = std::min(rest.find('\n'), rest.size());
        arguments.emplace_back(rest.substr(0, length));
        rest.remove_prefix(std::min(length + 1, rest.size()));
    }
    std::reverse(arguments.begin(), arguments.end()); // as CLI11 takes them

    Spotlight light;
    Camera camera;
    RunOptions run;
    double number = 0.0;
    CLI::App app;
    add_light_options(app, light);
    add_camera_options(app, camera, false);
    add_run_options(app, run);
    add_seed_option(app, run);
    add_number(app, "--number", number, "any");
    accept_refusal([&] {
        try {
            app.parse(arguments);
        } catch (const CLI::ParseError&) { // main() tells of it
            return;
        }
        require(std::isfinite(number), "a number is finite");
        require(run.threads >= 0 && run.threads <= 4096, "threads are few");
        light.check();
        if (camera_was_given(app)) camera.check();
        require(camera.width > 0 && camera.height > 0, "a picture is not empty");
    });
    return 0;
}
