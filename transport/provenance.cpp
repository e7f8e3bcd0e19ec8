#include "transport/provenance.h"

#include "core/error.h"

#include <cstdio>
#include <filesystem>
#include <system_error>
#include <unistd.h>

namespace afterglow {
namespace {

std::string vector_text(const Eigen::Ref<const Vec3>& v) {
    return number_text(v.x()) + "," + number_text(v.y()) + "," + number_text(v.z());
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

void check_output(const std::string& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        throw FileError(path, "is a directory; name a file in it");
    if (std::filesystem::is_other(path, ignored)) return; // a device has no file beside it
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    const std::string name = folder.empty() ? "." : folder.string();
    if (!std::filesystem::is_directory(name, ignored))
        throw FileError(path, "cannot be created: there is no folder " + name);
    if (::access(name.c_str(), W_OK) != 0)
        throw FileError(path, "cannot be created: the folder " + name + " may not be written to");
}

} // namespace afterglow
