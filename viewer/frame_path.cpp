#include "viewer/frame_path.h"

#include "core/error.h"
#include "core/file.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <span>

namespace afterglow {
namespace {

using Json = nlohmann::json;

/// An object of the file, with words for what is wrong in it.
struct Entry {
    const std::string& file;
    std::string where;
    const Json& object;

    [[noreturn]] void fail(const std::string& what) const { throw FileError(file, where + ": " + what); }
    void allow(std::initializer_list<const char*> names) const {
        if (!object.is_object()) fail("is not an object");
        for (const auto& item : object.items()) {
            const std::string& given = item.key();
            if (std::none_of(names.begin(), names.end(), [&](const char* n) { return given == n; }))
                fail("unknown name \"" + printable(given) + "\"");
        }
    }
    bool has(const char* name) const { return object.contains(name); }
    double number(const Json& value, const char* name) const {
        if (!value.is_number() || !std::isfinite(value.get<double>())
            || !std::isfinite(static_cast<float>(value.get<double>())))
            fail(std::string("\"") + name + "\" must be made of finite numbers");
        return value.get<double>();
    }
    void read(const char* name, double& to) const {
        if (has(name)) to = number(object.at(name), name);
    }
    void read(const char* name, std::span<float> to) const {
        if (!has(name)) return;
        const Json& value = object.at(name);
        if (!value.is_array() || value.size() != to.size())
            fail(std::string("\"") + name + "\" must be " + std::to_string(to.size()) + " numbers");
        for (std::size_t k = 0; k < to.size(); ++k) to[k] = static_cast<float>(number(value[k], name));
    }
    void require(std::initializer_list<const char*> names) const {
        for (const char* name : names)
            if (!has(name)) fail(std::string("\"") + name + "\" is missing in the first entry");
    }
};

std::span<float> components(Vec3& v) { return {v.data(), 3}; }

void read_camera(const Entry& entry, Camera& camera) {
    entry.allow({"position", "target", "up", "fov"});
    entry.read("position", components(camera.position));
    entry.read("target", components(camera.target));
    entry.read("up", components(camera.up));
    double fov = camera.vertical_fov;
    entry.read("fov", fov);
    camera.vertical_fov = static_cast<float>(fov);
}

void read_light(const Entry& entry, Spotlight& light) {
    entry.allow({"position", "direction", "cone", "intensity"});
    entry.read("position", components(light.position));
    entry.read("direction", components(light.direction));
    std::array<float, 2> cone = {light.inner_angle, light.outer_angle};
    entry.read("cone", cone);
    light.inner_angle = cone[0];
    light.outer_angle = cone[1];
    entry.read("intensity", std::span(light.intensity.data(), 3));
}

Json array(const auto& values) { return {values[0], values[1], values[2]}; }

Vec3 between(const Vec3& a, const Vec3& b, float t) { return (1.0f - t) * a + t * b; }

} // namespace

std::vector<Frame> read_frame_path(const std::string& path) {
    const MappedFile file(path);
    const auto bytes = file.bytes();
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    Json all;
    try {
        all = Json::parse(text, text + bytes.size());
    } catch (const Json::exception& error) {
        throw FileError(path, "is no JSON: " + printable(error.what(), 200));
    }
    if (!all.is_array() || all.empty()) throw FileError(path, "must be an array of frames");
    std::vector<Frame> frames;
    for (std::size_t k = 0; k < all.size(); ++k) {
        Frame frame = frames.empty() ? Frame{} : frames.back();
        const std::string where = "frame " + std::to_string(k);
        const Entry entry{path, where, all[k]};
        entry.allow({"time", "camera", "light"});
        if (k == 0) entry.require({"camera", "light"});
        entry.read("time", frame.time);
        if (!frames.empty() && frame.time < frames.back().time) entry.fail("\"time\" falls");
        if (entry.has("camera")) {
            const Entry camera{path, where + ", camera", entry.object.at("camera")};
            read_camera(camera, frame.camera);
            if (k == 0) camera.require({"position", "target"});
        }
        if (entry.has("light")) {
            const Entry light{path, where + ", light", entry.object.at("light")};
            read_light(light, frame.light);
            if (k == 0) light.require({"position", "direction"});
        }
        try {
            frame.camera.check();
            frame.light.check();
        } catch (const UsageError& error) {
            entry.fail(error.what());
        }
        frames.push_back(frame);
    }
    return frames;
}

void write_frame_path(const std::string& path, const std::vector<Frame>& frames) {
    Json all = Json::array();
    for (const Frame& f : frames)
        all.push_back({{"time", f.time},
                       {"camera",
                        {{"position", array(f.camera.position)},
                         {"target", array(f.camera.target)},
                         {"up", array(f.camera.up)},
                         {"fov", f.camera.vertical_fov}}},
                       {"light",
                        {{"position", array(f.light.position)},
                         {"direction", array(f.light.direction)},
                         {"cone", {f.light.inner_angle, f.light.outer_angle}},
                         {"intensity", array(f.light.intensity)}}}});
    write_file(path, all.dump(1) + "\n");
}

Frame frame_at(const std::vector<Frame>& frames, double time) {
    const auto next = std::upper_bound(frames.begin(), frames.end(), time,
                                       [](double t, const Frame& f) { return t < f.time; });
    if (next == frames.begin()) return frames.front();
    if (next == frames.end()) return frames.back();
    const Frame &a = *(next - 1), &b = *next;
    const auto t = static_cast<float>((time - a.time) / (b.time - a.time));
    const auto number = [t](float x, float y) { return (1.0f - t) * x + t * y; };
    Frame f = a;
    f.time = time;
    f.camera.position = between(a.camera.position, b.camera.position, t);
    f.camera.target = between(a.camera.target, b.camera.target, t);
    f.camera.up = between(a.camera.up, b.camera.up, t);
    f.camera.vertical_fov = number(a.camera.vertical_fov, b.camera.vertical_fov);
    f.light.position = between(a.light.position, b.light.position, t);
    // Opposite directions have nothing between them.
    const Vec3 direction = between(a.light.direction, b.light.direction, t);
    if (direction.norm() > 1e-3f) f.light.direction = direction.normalized();
    f.light.inner_angle = number(a.light.inner_angle, b.light.inner_angle);
    f.light.outer_angle = number(a.light.outer_angle, b.light.outer_angle);
    f.light.intensity = (1.0f - t) * a.light.intensity + t * b.light.intensity;
    return f;
}

} // namespace afterglow
