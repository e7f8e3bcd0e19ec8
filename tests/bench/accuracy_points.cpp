#include "tests/bench/accuracy_points.h"

#include "core/error.h"
#include "core/file.h"
#include "core/sampling.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace afterglow {
namespace {

using Json = nlohmann::json;

constexpr int light_count = 3;
constexpr int columns = 6 + 9 * light_count;

Json read_json(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw FileError(path, "cannot be opened");
    try {
        return Json::parse(file);
    } catch (const Json::exception& error) {
        throw FileError(path, error.what());
    }
}

Vec3 to_vector(const Json& json) {
    return {json.at(0).get<float>(), json.at(1).get<float>(), json.at(2).get<float>()};
}

Spotlight to_spotlight(const Json& json) {
    Spotlight light;
    light.position = to_vector(json.at("position"));
    light.direction = to_vector(json.at("direction"));
    light.outer_angle = json.at("half_angle").get<float>();
    light.inner_angle = light.outer_angle - 5.0f;
    light.check();
    return light;
}

Json to_json(const Spotlight& light) {
    return {{"position", {light.position.x(), light.position.y(), light.position.z()}},
            {"direction", {light.direction.x(), light.direction.y(), light.direction.z()}},
            {"inner_angle", light.inner_angle},
            {"outer_angle", light.outer_angle},
            {"intensity", {light.intensity[0], light.intensity[1], light.intensity[2]}}};
}

Json description(const Surface& surface, const AccuracyScene& scene,
                 const ReferenceOptions& options) {
    Json lights = Json::array();
    for (const Spotlight& light : scene.lights)
        lights.push_back(to_json(light));
    return {{"scene", scene.name},
            {"scene_hash", surface.scene().content_hash()},
            {"viewpoint", {scene.viewpoint.x(), scene.viewpoint.y(), scene.viewpoint.z()}},
            {"lights", lights},
            {"points_at_each_place", options.points},
            {"seed", options.seed}};
}

std::string cache_path(const AccuracyScene& scene, const Json& what,
                       const ReferenceOptions& options) {
    const std::string text = what.dump();
    std::string name = scene.name;
    std::replace(name.begin(), name.end(), ':', '_');
    return (std::filesystem::path(options.cache)
            / (name + "-" + std::to_string(options.points) + "-"
               + hash_hex(std::as_bytes(std::span(text))).substr(0, 12) + ".csv"))
        .string();
}

void write(const std::string& path, const AccuracyReference& reference, const Json& what) {
    std::ostringstream text;
    text.precision(9);
    text << "# " << what.dump() << "\nx,y,z,nx,ny,nz";
    for (int l = 1; l <= light_count; ++l)
        for (const char* kind : {"direct", "indirect", "error"})
            for (const char channel : {'r', 'g', 'b'})
                text << ',' << kind << l << '_' << channel;
    text << '\n';
    const IrradianceEstimate& e = reference.irradiance;
    for (std::size_t p = 0; p < reference.points.size(); ++p) {
        const SurfacePoint& x = reference.points[p];
        text << x.position.x() << ',' << x.position.y() << ',' << x.position.z() << ','
             << x.normal.x() << ',' << x.normal.y() << ',' << x.normal.z();
        for (int l = 0; l < light_count; ++l)
            for (const Eigen::Array3Xf* kind : {&e.direct, &e.indirect, &e.standard_error})
                for (int c = 0; c < 3; ++c)
                    text << ',' << (*kind)(c, static_cast<Index>(p) * light_count + l);
        text << '\n';
    }
    write_file(path, text.str());
}

AccuracyReference read(const std::string& path) {
    std::ifstream file(path);
    std::string line;
    if (!std::getline(file, line) || !line.starts_with("# "))
        throw FileError(path, "is no cached reference; remove it");
    const Json what = Json::parse(line.substr(2));
    std::getline(file, line); // names of the columns
    std::vector<float> values;
    while (std::getline(file, line)) {
        std::istringstream row(line);
        float value = 0.0f;
        for (char comma = 0; row >> value; row >> comma)
            values.push_back(value);
    }
    if (values.empty() || values.size() % columns != 0)
        throw FileError(path, "is damaged; remove it");
    const auto table =
        Eigen::ArrayXXf::Map(values.data(), columns, static_cast<Index>(values.size()) / columns);
    AccuracyReference reference;
    IrradianceEstimate& e = reference.irradiance;
    for (Eigen::Array3Xf* kind : {&e.direct, &e.indirect, &e.standard_error})
        kind->resize(3, table.cols() * light_count);
    for (Index p = 0; p < table.cols(); ++p) {
        reference.points.push_back({table.col(p).segment<3>(0), table.col(p).segment<3>(3)});
        for (int l = 0; l < light_count; ++l) {
            e.direct.col(p * light_count + l) = table.col(p).segment<3>(6 + 9 * l);
            e.indirect.col(p * light_count + l) = table.col(p).segment<3>(9 + 9 * l);
            e.standard_error.col(p * light_count + l) = table.col(p).segment<3>(12 + 9 * l);
        }
    }
    e.relative_error = what.at("relative_error").get<std::vector<double>>();
    e.samples = what.at("samples").get<std::uint64_t>();
    e.rays = what.at("rays").get<std::uint64_t>();
    reference.seconds = what.at("seconds").get<double>();
    reference.from_cache = true;
    return reference;
}

} // namespace

AccuracyScene find_accuracy_scene(const std::string& name, const std::string& scenes_file,
                                  const std::string& lights_file) {
    const Json lights = read_json(lights_file);
    if (!lights.contains(name)) throw FileError(lights_file, "has no scene '" + name + "'");
    Json listed = lights.at(name);
    AccuracyScene scene{.name = name, .path = name, .viewpoint = {}, .lights = {}};
    try {
        if (!listed.contains("view")) {
            if (scenes_file.empty())
                throw UsageError("scene '" + name
                                 + "' needs --scenes FILE or AFTERGLOW_SCENES, the list of scenes");
            const Json entry = read_json(scenes_file).at(name);
            scene.path = (std::filesystem::path(scenes_file).parent_path()
                          / entry.at("file").get<std::string>())
                             .string();
            listed["view"] = entry.at("view");
            listed["spot"] = entry.at("spot");
        }
        scene.viewpoint = to_vector(listed.at("view").at("position"));
        Json at_the_eye = listed.at("view");
        at_the_eye["half_angle"] = 30.0f;
        scene.lights = {to_spotlight(listed.at("spot")), to_spotlight(at_the_eye),
                        to_spotlight(listed.at("other"))};
    } catch (const Json::exception& error) {
        throw Error("scene '" + name + "' in " + scenes_file + " and " + lights_file + ": "
                    + error.what());
    }
    return scene;
}

std::vector<SurfacePoint> visible_points(const Surface& surface, const AccuracyScene& scene,
                                         int count, std::uint64_t seed) {
    std::vector<SurfacePoint> points;
    for (std::uint64_t place = 0; place < 2; ++place) {
        const Vec3& origin = place == 0 ? scene.viewpoint : scene.lights[0].position;
        const auto wanted = static_cast<std::size_t>(count) * (place + 1);
        for (std::uint32_t i = 0; points.size() < wanted; ++i) {
            if (i >= 1000u * static_cast<std::uint32_t>(count))
                throw Error("hardly any ray from a viewpoint of " + scene.name
                            + " meets a surface");
            const Ray ray{origin, sample_sphere(scrambled_sobol2(i, hash64(seed, place)))};
            if (const Hit hit = surface.closest_hit(ray)) points.push_back(surface.point(hit));
        }
    }
    return points;
}

AccuracyReference accuracy_reference(const Surface& surface, const AccuracyScene& scene,
                                     const ReferenceOptions& options) {
    Json what = description(surface, scene, options);
    const std::string path = cache_path(scene, what, options);
    if (std::filesystem::exists(path)) {
        AccuracyReference cached = read(path);
        const auto& errors = cached.irradiance.relative_error;
        if (*std::max_element(errors.begin(), errors.end()) <= options.target_error) return cached;
    }
    AccuracyReference reference;
    reference.points = visible_points(surface, scene, options.points, options.seed);
    PathTracerOptions tracer = options.tracer;
    tracer.target_error = options.target_error;
    tracer.max_samples = options.max_samples;
    tracer.seed = options.seed;
    const auto start = std::chrono::steady_clock::now();
    reference.irradiance = estimate_irradiance(surface, scene.lights, reference.points, tracer);
    reference.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    what["version"] = AFTERGLOW_VERSION;
    what["target_error"] = options.target_error;
    what["relative_error"] = reference.irradiance.relative_error;
    what["samples"] = reference.irradiance.samples;
    what["rays"] = reference.irradiance.rays;
    what["seconds"] = reference.seconds;
    std::filesystem::create_directories(options.cache);
    write(path, reference, what);
    return reference;
}

} // namespace afterglow
