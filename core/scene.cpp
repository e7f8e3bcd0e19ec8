#include "core/scene.h"

#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/file.h"
#include "core/obj_loader.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <span>

namespace afterglow {
namespace {

/// The two texels beside a coordinate that repeats with period 1, and the weight of the second.
struct Neighbours {
    int first, second;
    float weight;
    Neighbours(float coordinate, int size) {
        const float place = (coordinate - std::floor(coordinate)) * static_cast<float>(size) - 0.5f;
        const float below = std::floor(place);
        weight = place - below;
        // place lies in [-1/2, size - 1/2]; both ends wrap around.
        first = (static_cast<int>(below) + size) % size;
        second = (first + 1) % size;
    }
};

/// Appends "count what" where count is not zero.
void append(std::string& line, std::uint64_t count, const std::string& what) {
    if (count > 0) line += (line.empty() ? "" : ", ") + std::to_string(count) + " " + what;
}

/// "what a, b, c and 2 more"; empty where there are no names. A name out of a damaged file may hold
/// anything.
std::string list(const std::string& what, const std::vector<std::string>& names) {
    constexpr std::size_t most_names = 5, longest = 256;
    std::string text;
    for (std::size_t i = 0; i < std::min(names.size(), most_names); ++i)
        text += (i == 0 ? what : ", ") + printable(names[i], longest);
    if (names.size() > most_names)
        text += " and " + std::to_string(names.size() - most_names) + " more";
    return text;
}

template <class T>
std::string hash_of(const std::vector<T>& values) {
    return hash_hex(std::as_bytes(std::span(values)));
}

} // namespace

Rgb Texture::sample(const Vec2& uv) const {
    const Neighbours x(uv.x(), width), y(uv.y(), height);
    const auto texel = [&](int column, int row) -> Rgb {
        return Rgb::Map(&rgb[3 * (static_cast<std::size_t>(row) * width + column)]);
    };
    const Rgb lower =
        (1.0f - x.weight) * texel(x.first, y.first) + x.weight * texel(x.second, y.first);
    const Rgb upper =
        (1.0f - x.weight) * texel(x.first, y.second) + x.weight * texel(x.second, y.second);
    return (1.0f - y.weight) * lower + y.weight * upper;
}

std::string SceneSummary::line() const {
    std::string dropped, mended;
    append(dropped, dropped_degenerate, "of zero area");
    append(dropped, dropped_not_finite, "not finite");
    append(dropped, dropped_bad_index, "with a bad index");
    append(mended, replaced_normals, "corners without a usable normal");
    append(mended, default_material, "triangles in default grey");
    append(mended, clamped_reflectance, "reflectances clamped");

    std::string line =
        std::to_string(faces) + " faces, " + std::to_string(triangles) + " triangles";
    if (!dropped.empty()) line += "; dropped: " + dropped;
    if (!mended.empty()) line += "; " + mended;
    line += list("; cannot read ", missing_files);
    if (!outside_files.empty()) line += "; " + outside_line();
    return line;
}

std::string SceneSummary::outside_line() const {
    return list("read from outside the scene's folder: ", outside_files);
}

Eigen::AlignedBox3f Scene::bounds() const {
    Eigen::AlignedBox3f box;
    for (const Vec3& p : positions)
        box.extend(p);
    return box;
}

Vec3 Scene::triangle_normal(std::uint32_t triangle) const {
    const Triangle& t = triangles[triangle];
    const auto corner = [&](int k) -> Eigen::Vector3d { return positions[t[k]].cast<double>(); };
    // In double: rounded to floats, the two products of a needle's cross product cancel to nothing.
    return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized().cast<float>();
}

std::string Scene::content_hash() const {
    // Hash of the parts' hashes: names, summary, viewpoint and normal maps are not part of what light
    // sees.
    std::string parts = hash_of(positions) + hash_of(triangles) + hash_of(normals)
                        + hash_of(normal_indices) + hash_of(texture_coordinates)
                        + hash_of(texture_indices) + hash_of(material_index);
    for (const Material& material : materials) {
        parts += hash_hex(std::as_bytes(std::span(material.reflectance.data(), 3)));
        parts += std::to_string(material.texture) + ";";
    }
    for (const Texture& texture : textures)
        parts += std::to_string(texture.width) + "x" + std::to_string(texture.height)
                 + hash_of(texture.rgb);
    return hash_hex(std::as_bytes(std::span(parts)));
}

Scene load_scene(const std::string& path_or_name) {
    return is_builtin_scene(path_or_name) ? make_builtin_scene(path_or_name)
                                          : load_obj(path_or_name);
}

} // namespace afterglow
