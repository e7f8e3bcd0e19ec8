#include "transport/command_compare.h"

#include "core/error.h"
#include "core/image.h"
#include "transport/csv_points.h"
#include "transport/measures.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

namespace afterglow {
namespace {

struct CompareCommand {
    std::string picture, reference;
    bool json = false;
};

struct Samples {
    Eigen::Array3Xf x, y;
    std::optional<double> reference_error; // as the reference states it
};

/// The pixels at which at least one of the two is not black.
Samples covered_pixels(const CompareCommand& command) {
    const Image a = read_exr(command.picture), b = read_exr(command.reference);
    if (a.width != b.width || a.height != b.height)
        throw FileError(command.picture,
                        "has " + std::to_string(a.width) + "x" + std::to_string(a.height)
                            + " pixels, the reference has " + std::to_string(b.width) + "x"
                            + std::to_string(b.height));
    const Eigen::Index pixels = static_cast<Eigen::Index>(a.width) * a.height;
    Samples samples{Eigen::Array3Xf(3, pixels), Eigen::Array3Xf(3, pixels), {}};
    const auto x = Eigen::Array3Xf::Map(a.rgb.data(), 3, pixels);
    const auto y = Eigen::Array3Xf::Map(b.rgb.data(), 3, pixels);
    Eigen::Index covered = 0;
    for (Eigen::Index k = 0; k < pixels; ++k)
        if ((x.col(k) != 0.0f).any() || (y.col(k) != 0.0f).any()) {
            samples.x.col(covered) = x.col(k);
            samples.y.col(covered++) = y.col(k);
        }
    samples.x.conservativeResize(3, covered);
    samples.y.conservativeResize(3, covered);
    const auto stated = b.attributes.find("afterglow.relative_standard_error");
    if (stated == b.attributes.end()) return samples;
    double error = 0.0;
    const std::string& text = stated->second;
    if (std::from_chars(text.data(), text.data() + text.size(), error).ec != std::errc{} || !std::isfinite(error))
        throw FileError(command.reference, "has an attribute afterglow.relative_standard_error that is no number");
    samples.reference_error = error;
    return samples;
}

Samples read_samples(const CompareCommand& command) {
    const auto is_csv = [](const std::string& path) { return path.ends_with(".csv"); };
    if (is_csv(command.picture) != is_csv(command.reference))
        throw UsageError("compare takes two EXR pictures or two CSV files, not one of each");
    if (!is_csv(command.picture)) return covered_pixels(command);
    return {read_irradiance_csv(command.picture), read_irradiance_csv(command.reference), {}};
}

void run(const CompareCommand& command) {
    const Samples samples = read_samples(command);
    const Measures m = measure(samples.x, samples.y);
    if (command.json) {
        nlohmann::json result = {{"samples", m.samples},   {"reference_mean", m.reference_mean},
                                 {"rel_rmse", m.rel_rmse}, {"rel_l1", m.rel_l1},
                                 {"bias", m.bias},         {"median", m.median},
                                 {"p95", m.p95},           {"p99", m.p99}};
        if (samples.reference_error) result["reference_standard_error"] = *samples.reference_error;
        std::printf("%s\n", result.dump().c_str());
        return;
    }
    std::printf("relRMSE %.3f %%\nrelL1   %.3f %%\nbias    %+.3f %%\n"
                "median  %.3f %%\np95     %.3f %%\np99     %.3f %%\n",
                100.0 * m.rel_rmse, 100.0 * m.rel_l1, 100.0 * m.bias, 100.0 * m.median,
                100.0 * m.p95, 100.0 * m.p99);
    std::printf("samples %lld, reference mean %.6g", static_cast<long long>(m.samples),
                m.reference_mean);
    if (samples.reference_error) std::printf(", its own standard error %.3f %%", 100.0 * *samples.reference_error);
    std::printf("\n");
}

} // namespace

void add_compare_command(CLI::App& app) {
    CLI::App* sub =
        app.add_subcommand("compare", "How far a picture or CSV file is from a reference");
    const auto command = std::make_shared<CompareCommand>();
    sub->add_option("a", command->picture, "What is measured (EXR, or CSV of E_r,E_g,E_b)")
        ->required()
        ->type_name("FILE");
    sub->add_option("b", command->reference, "The reference, of the same kind and size")
        ->required()
        ->type_name("FILE");
    sub->add_flag("--json", command->json, "One line of JSON");
    sub->callback([command] { run(*command); });
}

} // namespace afterglow
