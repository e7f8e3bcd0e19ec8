#include "transport/provenance.h"

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <unistd.h>

namespace afterglow {
namespace {

namespace fs = std::filesystem;

std::string vector_text(const Eigen::Ref<const Vec3>& v) {
    return number_text(v.x()) + "," + number_text(v.y()) + "," + number_text(v.z());
}

void check_output(const std::string& path) {
    std::error_code ignored;
    if (fs::is_directory(path, ignored)) throw FileError(path, "is a directory; name a file in it");
    const OutputTarget target = output_target(path);
    if (target.descriptor || fs::is_other(path, ignored)) return; // a device has no file beside it
    const fs::path folder = fs::path(target.path).parent_path();
    const std::string name = folder.empty() ? "." : folder.string();
    if (!fs::is_directory(name, ignored)) throw FileError(path, "cannot be created: there is no folder " + name);
    if (::access(name.c_str(), W_OK) != 0)
        throw FileError(path, "cannot be created: the folder " + name + " may not be written to");
}

bool are_one_file(const std::string& a, const std::string& b) {
    std::error_code ignored;
    if (a.empty() || b.empty() || fs::is_other(a, ignored)) return false;
    const auto whole = [&](const std::string& path) { return fs::weakly_canonical(fs::absolute(path, ignored), ignored); };
    return fs::equivalent(a, b, ignored) || whole(a) == whole(b);
}

} // namespace

std::string number_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

std::map<std::string, std::string> light_attributes(const Spotlight& light) {
    return {{"afterglow.light_position", vector_text(light.position)},
            {"afterglow.light_direction", vector_text(light.direction)},
            {"afterglow.light_cone",
             number_text(light.inner_angle) + "," + number_text(light.outer_angle)},
            {"afterglow.light_intensity", vector_text(light.intensity.matrix())}};
}

void check_outputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs) {
    if (outputs.front().empty()) throw UsageError("the output has no name");
    for (auto output = outputs.begin(); output != outputs.end(); ++output) {
        if (!output->empty()) check_output(*output);
        const auto is_output = [&](const std::string& other) { return are_one_file(*output, other); };
        if (std::any_of(outputs.begin(), output, is_output))
            throw UsageError(*output + " cannot hold two results; name another file");
        if (std::any_of(inputs.begin(), inputs.end(), is_output))
            throw UsageError(*output + " is what is read, and would be lost; name another file");
    }
}

void check_scene_name(const std::string& scene) {
    try {
        (void)nlohmann::json(scene).dump();
    } catch (const nlohmann::json::exception&) {
        throw UsageError("the scene's path is not UTF-8, which results cannot hold; rename it");
    }
    if (!is_line_of_text(scene))
        throw UsageError("the scene's path has a line end or another control character, or over 4096 bytes, which results cannot hold; rename it");
}

} // namespace afterglow
