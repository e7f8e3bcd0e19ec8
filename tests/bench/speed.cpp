#include "basis/openness.h"
#include "core/embree.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/peak_memory.h"
#include "core/sampling.h"
#include "core/seconds.h"
#include "tests/bench/lookup.h"
#include "transport/moving_light.h"
#include "transport/precompute.h"
#include "transport/transfer_file.h"

#include <CLI/CLI.hpp>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

// Speed beside what it is made of, in one run, by hand: `precompute` against Embree alone with the same
// rays, `load` against tinyobjloader alone, `update` of a moving light against reading its operator once,
// `lookup` of functions in three ways.

namespace afterglow {
namespace {

using Clock = std::chrono::steady_clock;

/// Embree as anyone would use it: the scene's triangles, its best tree, one ray a call.
class EmbreeAlone {
public:
    explicit EmbreeAlone(const Scene& scene) : device_(rtcNewDevice(nullptr)), scene_(rtcNewScene(device_)) {
        rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
        RTCGeometry mesh = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
            mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), scene.positions.size()));
        auto* indices = static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(
            mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), scene.triangles.size()));
        for (std::size_t i = 0; i < scene.positions.size(); ++i)
            std::copy_n(scene.positions[i].data(), 3, vertices + 3 * i);
        for (std::size_t i = 0; i < scene.triangles.size(); ++i)
            std::copy_n(scene.triangles[i].data(), 3, indices + 3 * i);
        rtcCommitGeometry(mesh);
        rtcAttachGeometry(scene_, mesh);
        rtcReleaseGeometry(mesh);
        rtcCommitScene(scene_);
    }
    ~EmbreeAlone() {
        rtcReleaseScene(scene_);
        rtcReleaseDevice(device_);
    }
    EmbreeAlone(const EmbreeAlone&) = delete;
    EmbreeAlone& operator=(const EmbreeAlone&) = delete;

    /// The sum of all distances, for something to come of it.
    double trace(std::span<const Ray> rays) const {
        double sum = 0.0;
        for (const Ray& ray : rays) {
            RTCRayHit query{};
            query.ray.org_x = ray.origin.x(), query.ray.org_y = ray.origin.y(), query.ray.org_z = ray.origin.z();
            query.ray.dir_x = ray.direction.x(), query.ray.dir_y = ray.direction.y(),
            query.ray.dir_z = ray.direction.z();
            query.ray.tfar = ray.length;
            query.ray.mask = ~0u;
            query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            embree_intersect(scene_, query);
            if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID) sum += query.ray.tfar;
        }
        return sum;
    }

private:
    RTCDevice device_;
    RTCScene scene_;
};

/// Seconds that Embree alone takes for the gather's rays.
double gather_rays_alone(const Surface& surface, const EmbreeAlone& embree, const PointHierarchy& points,
                         const LinkOptions& options) {
    double seconds = 0.0;
    for (int l = 0; l < points.levels(); ++l) {
        if (!points.leads_to_display(l)) continue;
        const GatherDirections directions = gather_directions(options, points, l);
        const auto rays = static_cast<std::size_t>(directions.rays());
        constexpr Index at_once = 256; // points whose rays are made before the clock runs
        std::vector<Ray> ray(at_once * rays);
        for (Index begin = points.begin(l); begin < points.end(l); begin += at_once) {
            const Index count = std::min<Index>(at_once, points.end(l) - begin);
            parallel_for(count, [&](Index r) {
                Eigen::Matrix3Xf local;
                const SurfacePoint x = points.point(begin + r);
                const Frame frame(x.normal);
                directions.deal(begin + r - points.begin(l), local);
                for (std::size_t k = 0; k < rays; ++k)
                    ray[static_cast<std::size_t>(r) * rays + k] = {
                        surface.lifted(x), frame.to_world(local.col(static_cast<Index>(k)))};
            }, 16);
            const auto start = Clock::now();
            parallel_ranges(count, 16, [&](Index first, Index last) {
                volatile double keep = embree.trace(std::span(ray).subspan(
                    static_cast<std::size_t>(first) * rays, static_cast<std::size_t>(last - first) * rays));
                (void)keep;
            });
            seconds += seconds_since(start);
        }
    }
    return seconds;
}

/// The gather's rays, were none spared: as many on the display level as on the next one, and on coarser ones as many
/// as make their links no noisier, (R_l / R_L)^1.5 times as many.
std::uint64_t rays_unless_spared(const PointHierarchy& points, const LinkOptions& options) {
    std::uint64_t rays = 0;
    for (int l = 0; l < points.levels(); ++l) {
        if (!points.leads_to_display(l)) continue;
        const double ratio = std::max(1.0f, points.spacing[l] / points.spacing.back());
        const double wanted = std::min<double>(options.rays * std::pow(ratio, 1.5), options.most_rays);
        rays += static_cast<std::uint64_t>(points.end(l) - points.begin(l)) << static_cast<int>(std::log2(wanted) + 0.01);
    }
    return rays;
}

/// Seconds to evaluate the openness feature at all points that carry one.
double features_alone(const Surface& surface, const PointHierarchy& points) {
    const auto start = Clock::now();
    for (int l = points.openness_level; l < points.levels(); ++l) {
        const OpennessProbe probe(surface, points.spacing[l]);
        parallel_for(points.end(l) - points.begin(l), [&](Index k) {
            volatile float keep = probe(points.point(points.begin(l) + k))[0];
            (void)keep;
        });
    }
    return seconds_since(start);
}

struct Run {
    double total, points, links, alone, features;
    std::uint64_t rays, rays_unless_spared;
};

Run run_once(const Surface& surface, const EmbreeAlone& embree, const PrecomputeOptions& options) {
    PrecomputeReport r;
    const TransferOperator transfer = precompute(surface, options, &r);
    return {r.total_seconds, r.points_seconds,
            r.links.trace_seconds + r.links.rows_seconds + r.links.links_seconds,
            gather_rays_alone(surface, embree, transfer.points, options.links),
            features_alone(surface, transfer.points),
            r.links.rays, rays_unless_spared(transfer.points, options.links)};
}

void run_precompute(const std::vector<std::string>& names, int repeat, bool one_thread) {
    std::printf("%-14s %9s %8s %8s %8s %8s %8s %8s %8s %8s\n", "scene", "total s", "links s", "Embree s", "ratio",
                "points", "features", "threads", "Mrays", "of all");
    for (const std::string& name : names) {
        const double before = peak_memory();
        const Scene scene = load_scene(name);
        const Surface surface(scene);
        const EmbreeAlone embree(scene);
        Run best = run_once(surface, embree, {}); // each by itself
        double single = 0.0;
        for (int k = 1; k < repeat; ++k) {
            const Run run = run_once(surface, embree, {});
            best = {std::min(best.total, run.total), std::min(best.points, run.points), std::min(best.links, run.links),
                    std::min(best.alone, run.alone), std::min(best.features, run.features), run.rays,
                    run.rays_unless_spared};
        }
        if (one_thread) {
            const ThreadLimit limit(1);
            PrecomputeReport r;
            precompute(surface, {}, &r);
            single = r.total_seconds;
        }
        const std::size_t slash = name.rfind('/');
        std::printf("%-14s %9.2f %8.2f %8.2f %8.2f %8.3f %8.3f %8.2f %8.1f %8.2f  (%.0f MB at most)\n",
                    name.substr(slash == std::string::npos ? 0 : slash + 1).c_str(), best.total, best.links,
                    best.alone, best.links / best.alone, best.points / best.total, best.features / best.total,
                    single / best.total, 1e-6 * static_cast<double>(best.rays),
                    static_cast<double>(best.rays) / static_cast<double>(best.rays_unless_spared),
                    1e-6 * (peak_memory() - before));
        std::fflush(stdout);
    }
}

/// Seconds to load a scene, beside what tinyobjloader takes for its own parse, which leaves the scene to be made.
void run_load(const std::string& name, int repeat) {
    double loaded = std::numeric_limits<double>::infinity(), parsed = loaded;
    std::size_t triangles = 0;
    for (int k = 0; k < repeat; ++k) {
        const auto start = Clock::now();
        triangles = load_scene(name).triangles.size();
        loaded = std::min(loaded, seconds_since(start));
        const auto again = Clock::now();
        tinyobj::attrib_t attributes;
        std::vector<tinyobj::shape_t> shapes;
        std::vector<tinyobj::material_t> materials;
        std::string warnings, errors;
        const std::string folder = std::filesystem::path(name).parent_path().string() + "/";
        if (!tinyobj::LoadObj(&attributes, &shapes, &materials, &warnings, &errors, name.c_str(), folder.c_str()))
            throw Error("tinyobjloader: " + errors);
        parsed = std::min(parsed, seconds_since(again));
    }
    std::printf("%zu triangles loaded in %.2f s; tinyobjloader alone %.2f s, ratio %.2f\n", triangles, loaded, parsed,
                loaded / parsed);
}

/// A light that walks by steps of a centimetre through the middle of a scene.
struct UpdateOptions {
    std::string file;
    Vec3 from = {0.0f, 9.0f, 0.0f};
    int frames = 60;
    double tolerance = MovingLight::Options().tolerance;
};

/// Milliseconds, the best of many.
template <class Function>
double best_milliseconds(const Function& function) {
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 40; ++k) {
        const auto begin = Clock::now();
        function();
        best = std::min(best, 1e3 * seconds_since(begin));
    }
    return best;
}

void run_update(const UpdateOptions& options) {
    const auto start = Clock::now();
    const TransferFile file = load_transfer(options.file);
    const double opened = seconds_since(start);
    const Scene scene = load_transfer_scene(options.file, file.provenance);
    const Surface surface(scene);
    const auto ready = Clock::now();
    const LightTransport transport(file.transfer, surface);
    MovingLight moving(transport, {.tolerance = options.tolerance});
    const double prepared = seconds_since(ready);
    std::vector<std::array<double, 5>> stages; // direct, coefficients, links, push, all [ms]
    double first = 0.0, links_share = 0.0, rounds = 0.0, difference = 0.0;
    for (int frame = 0; frame <= options.frames; ++frame) {
        Spotlight light{.position = options.from + Vec3(0.01f * static_cast<float>(frame), 0.0f, 0.0f),
                        .direction = {-0.2f, -1.0f, 0.1f},
                        .inner_angle = 32.0f,
                        .outer_angle = 40.0f,
                        .intensity = Rgb::Constant(100.0f)};
        light.check();
        MovingLightStatistics s;
        const VectorIrradiance& field = moving.follow(light, &s);
        if (frame == options.frames) {
            const VectorIrradiance anew = transport.indirect(light);
            double squares = 0.0, size = 0.0;
            const PointHierarchy& points = file.transfer.points;
            for (std::size_t k = 9 * std::size_t{points.begin(points.levels() - 1)}; k < anew.size(); ++k) {
                squares += std::pow(static_cast<double>(field[k]) - anew[k], 2);
                size += std::pow(static_cast<double>(anew[k]), 2);
            }
            if (size == 0.0) throw Error("the light lights nothing that reflects: choose another --from");
            difference = std::sqrt(squares / size);
        }
        if (frame == 0) {
            first = 1e3 * s.seconds();
            continue;
        }
        links_share += s.links_share / options.frames;
        rounds += static_cast<double>(s.rounds) / options.frames;
        stages.push_back({1e3 * s.direct_seconds, 1e3 * s.coefficients_seconds, 1e3 * s.links_seconds,
                              1e3 * s.push_seconds, 1e3 * s.seconds()});
    }
    // What reading the operator once takes, at the speed of this memory.
    const auto bytes = static_cast<Index>(file.transfer.links.entries() * sizeof(PackedLink));
    std::vector<std::uint64_t> memory(static_cast<std::size_t>(bytes) / 8, 1);
    const double read = best_milliseconds([&] {
        volatile std::uint64_t sum = parallel_sum(static_cast<Index>(memory.size()), std::uint64_t{0},
                                                  [&](Index i) { return memory[static_cast<std::size_t>(i)]; }, 1 << 16);
        (void)sum;
    });
    const Radiosity flat(3 * static_cast<std::size_t>(file.transfer.senders()), 1.0f);
    const double bounce = best_milliseconds([&] { transport.bounce(flat); });
    const double gather = best_milliseconds([&] { transport.gather(flat); });
    std::printf("opened in %.1f ms, prepared in %.1f ms, first update %.1f ms\n", 1e3 * opened,
                1e3 * prepared, first);
    std::printf("links read once in %.1f ms; one bounce %.1f ms, all links and the push %.1f ms\n", read, bounce, gather);
    std::printf("%.1f %% of the links multiplied in %.1f rounds; in the end %.2f %% from all computed anew\n",
                100.0 * links_share, rounds, 100.0 * difference);
    const char* names[] = {"direct", "coefficients", "links", "push", "all"};
    for (std::size_t k = 0; k < 5; ++k) {
        std::vector<double> values;
        for (const auto& stage : stages) values.push_back(stage[k]);
        std::sort(values.begin(), values.end());
        std::printf("%-13s median %6.2f ms, best %6.2f, worst %6.2f\n", names[k], values[values.size() / 2],
                    values.front(), values.back());
    }
}

} // namespace
} // namespace afterglow

int main(int argc, char** argv) {
    CLI::App app("Speed beside what it is made of", "afterglow_speed");
    app.require_subcommand(1);
    std::vector<std::string> scenes;
    int repeat = 5;
    bool one_thread = false;
    CLI::App* precompute = app.add_subcommand("precompute", "Against Embree alone with the same rays");
    precompute->add_option("scenes", scenes, "OBJ files or builtin:NAME")->required();
    precompute->add_option("--repeat", repeat, "Times, of which the best counts (default 5)");
    precompute->add_flag("--one-thread", one_thread, "Once more with one thread");
    precompute->callback([&] { afterglow::run_precompute(scenes, repeat, one_thread); });
    afterglow::UpdateOptions options;
    CLI::App* update = app.add_subcommand("update", "A light that walks by centimetres");
    update->add_option("file", options.file, "Transfer file")->required();
    update->add_option("--tolerance", options.tolerance, "Of MovingLight");
    update->add_option("--frames", options.frames, "Steps (default 60)");
    update->add_option_function<std::vector<float>>(
        "--from", [&](const std::vector<float>& p) { options.from = {p[0], p[1], p[2]}; },
        "Where the light starts (default 0 9 0, Sponza's nave)")->expected(3);
    update->callback([&] { afterglow::run_update(options); });
    std::string scene;
    CLI::App* load = app.add_subcommand("load", "Against tinyobjloader alone");
    load->add_option("scene", scene, "OBJ file")->required();
    load->add_option("--repeat", repeat, "Times, of which the best counts (default 5)");
    load->callback([&] { afterglow::run_load(scene, repeat); });
    CLI::App* lookup = app.add_subcommand("lookup", "Functions where rays end: R-tree, hash grid, patch");
    lookup->add_option("scene", scene, "OBJ file or builtin:NAME")->required();
    lookup->callback([&] { afterglow::run_lookup(scene); });
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "afterglow_speed: %s\n", error.what());
        return 1;
    }
    return 0;
}
