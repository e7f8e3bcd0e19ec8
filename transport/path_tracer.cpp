#include "transport/path_tracer.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/light_vertices.h"
#include "transport/mean_estimator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace afterglow {
namespace {

constexpr std::size_t block_size = 64; // paths that advance together, for packets of rays

/// Where a path starts, and the factor from its irradiance to what is asked.
struct PathStart {
    SurfacePoint x;
    Vec3 normal; // irradiance is asked for with it; x.normal, or what a normal map makes of it
    Rgb weight = Rgb::Ones();
    std::uint32_t index = 0; // of its sample in the sequence
};

struct Path {
    SurfacePoint x;
    Vec3 normal; // as PathStart has it; x.normal from the first bounce on
    Rgb weight, throughput;
    std::uint32_t index;
    std::uint32_t slot; // of the light vertices it is joined with

    /// Whether a direction lies below the surface at x, though above `normal`'s horizon.
    bool is_below(const Vec3& direction) const {
        return normal != x.normal && direction.dot(x.normal) <= 0.0f;
    }
};

/// The lights, and what joining paths to their rays needs.
class PathTracer {
public:
    PathTracer(const Surface& surface, std::span<const Spotlight> lights, PathStrategy strategy)
        : surface_(surface), lights_(lights), falloffs_(lights.begin(), lights.end()) {
        if (strategy == PathStrategy::connected)
            for (const Spotlight& light : lights)
                samplers_.emplace_back(light);
    }

    /// Memory for trace(), one at a time.
    struct Workspace {
        std::array<Path, block_size> paths;
        std::array<Ray, block_size> rays;
        std::array<Hit, block_size> hits;
        std::vector<LightVertex> vertices; // [light][slot]
    };

    /// Follows at most block_size paths to their ends and adds what they gather of light l to
    /// sums[l]. Returns the number of rays.
    std::uint64_t trace(std::uint64_t seed, std::span<const PathStart> starts,
                        std::span<Eigen::Array3d> sums, Workspace& work) const {
        std::size_t alive = 0;
        for (const PathStart& start : starts) {
            const auto slot = static_cast<std::uint32_t>(alive);
            work.paths[alive++] = {start.x, start.normal, start.weight, Rgb::Ones(), start.index, slot};
        }
        std::uint64_t rays = connected() ? trace_from_lights(seed, starts, work) : 0;
        for (std::uint64_t depth = 0; alive > 0; ++depth) {
            const std::uint64_t bounce_seed = hash64(seed, depth);
            for (std::size_t k = 0; k < alive; ++k) {
                const Path& path = work.paths[k];
                if (connected()) rays += connect(path, sums, work);
                const Vec3 local = sample_cosine(shuffled_sobol2(path.index, bounce_seed));
                work.rays[k] = {surface_.lifted(path.x), Frame(path.normal).to_world(local)};
            }
            surface_.closest_hits({work.rays.data(), alive}, {work.hits.data(), alive});
            rays += alive;

            std::size_t survivors = 0;
            for (std::size_t k = 0; k < alive; ++k) {
                const Hit& hit = work.hits[k];
                if (!hit || work.paths[k].is_below(work.rays[k].direction)) continue;
                Path path = work.paths[k];
                const SurfacePoint from{path.x.position, path.normal};
                path.x = surface_.point(hit);
                path.normal = path.x.normal;
                path.throughput *= surface_.reflectance(hit);
                rays += add_direct_light(path, from, hit, sums);
                // Below one, so that even a scene of reflectance one lets every path end.
                const float survival = std::min(0.999f, path.throughput.maxCoeff());
                if (Rng(bounce_seed, path.index).uniform() >= survival) continue;
                path.throughput /= survival;
                work.paths[survivors++] = path;
            }
            alive = survivors;
        }
        return rays;
    }

private:
    bool connected() const { return !samplers_.empty(); }

    /// Next-event estimation at the vertex that a path has just reached.
    std::uint64_t add_direct_light(const Path& path, const SurfacePoint& from, const Hit& hit,
                                   std::span<Eigen::Array3d> sums) const {
        std::uint64_t rays = 0;
        for (std::size_t l = 0; l < lights_.size(); ++l) {
            const Rgb unoccluded = unoccluded_irradiance(lights_[l], falloffs_[l], path.x);
            if ((unoccluded == 0.0f).all()) continue;
            ++rays;
            if (surface_.blocked(surface_.lifted(path.x), lights_[l].position)) continue;
            float share = 1.0f;
            if (connected()) {
                const Vec3 normal = surface_.geometric_normal(hit);
                const float pdf =
                    light_vertex_pdf(samplers_[l], lights_[l], path.x.position, normal);
                share = cosine_share(from, path.x.position, normal, pdf);
            }
            sums[l] += (path.weight * path.throughput * unoccluded * share).cast<double>();
        }
        return rays;
    }

    std::uint64_t trace_from_lights(std::uint64_t seed, std::span<const PathStart> starts,
                                    Workspace& work) const {
        constexpr std::uint64_t light_dimension = 0x6c696768; // beyond any bounce of a path
        std::array<std::uint32_t, block_size> indices;
        for (std::size_t k = 0; k < starts.size(); ++k)
            indices[k] = starts[k].index;
        work.vertices.resize(block_size * lights_.size());
        for (std::size_t l = 0; l < lights_.size(); ++l)
            trace_light_vertices(surface_, lights_[l], samplers_[l],
                                 hash64(seed, light_dimension + l), {indices.data(), starts.size()},
                                 {&work.vertices[block_size * l], starts.size()});
        return starts.size() * lights_.size();
    }

    /// Joins a path's last vertex with the light vertices of its slot.
    std::uint64_t connect(const Path& path, std::span<Eigen::Array3d> sums,
                          const Workspace& work) const {
        std::uint64_t rays = 0;
        for (std::size_t l = 0; l < lights_.size(); ++l) {
            const LightVertex& y = work.vertices[block_size * l + path.slot];
            if ((y.radiosity == 0.0f).all()) continue;
            const Vec3 to_y = y.x.position - path.x.position;
            if (to_y.dot(path.normal) <= 0.0f || path.is_below(to_y)
                || to_y.dot(y.geometric_normal) >= 0.0f)
                continue;
            ++rays;
            if (surface_.blocked(surface_.lifted(path.x), surface_.lifted(y.x))) continue;
            const float share = cosine_share({path.x.position, path.normal}, y.x.position,
                                             y.geometric_normal, y.pdf);
            sums[l] += (path.weight * path.throughput * y.radiosity * share).cast<double>();
        }
        return rays;
    }

    const Surface& surface_;
    std::span<const Spotlight> lights_;
    std::vector<Falloff> falloffs_; // a light each
    std::vector<ConeSampler> samplers_; // one a light; none in plain path tracing
};

EstimatorOptions estimator_options(const PathTracerOptions& options) {
    return {options.samples, options.target_error, options.max_samples,
            options.batches, options.seed,         options.progress};
}

} // namespace

IrradianceEstimate estimate_irradiance(const Surface& surface, std::span<const Spotlight> lights,
                                       std::span<const SurfacePoint> points,
                                       const PathTracerOptions& options) {
    const auto point_count = static_cast<Index>(points.size());
    const auto light_count = static_cast<Index>(lights.size());
    const PathTracer tracer(surface, lights, options.strategy);
    const Sampler sampler = [&](Index item, std::uint64_t seed, Index first, Index count,
                                std::span<Eigen::Array3d> sums) {
        std::array<PathStart, block_size> starts;
        PathTracer::Workspace work;
        std::uint64_t rays = 0;
        for (Index done = 0; done < count;) {
            std::size_t used = 0;
            for (; used < block_size && done < count; ++used, ++done)
                starts[used] = {points[static_cast<std::size_t>(item)],
                                points[static_cast<std::size_t>(item)].normal, Rgb::Ones(),
                                static_cast<std::uint32_t>(first + done)};
            rays += tracer.trace(seed, {starts.data(), used}, sums, work);
        }
        return rays;
    };
    MeanEstimate means =
        estimate_means(point_count, light_count, sampler, estimator_options(options));

    IrradianceEstimate result;
    result.indirect = std::move(means.mean);
    result.standard_error = std::move(means.standard_error);
    result.relative_error = std::move(means.relative_error);
    result.samples = means.samples;
    result.rays = means.rays;
    result.direct.resize(3, point_count * light_count);
    parallel_for(point_count * light_count, [&](Index k) {
        result.direct.col(k) =
            direct_irradiance(surface, lights[static_cast<std::size_t>(k % light_count)],
                              points[static_cast<std::size_t>(k / light_count)]);
    });
    return result;
}

PathStrategy strategy_from_name(std::string_view name) {
    for (const PathStrategy strategy : {PathStrategy::plain, PathStrategy::connected})
        if (name == strategy_name(strategy)) return strategy;
    throw UsageError("unknown strategy '" + std::string(name) + "'; there are plain and connected");
}

std::string strategy_name(PathStrategy strategy) {
    return strategy == PathStrategy::plain ? "plain" : "connected";
}

Layer layer_from_name(std::string_view name) {
    for (const Layer layer : {Layer::direct, Layer::indirect, Layer::full, Layer::irradiance})
        if (name == layer_name(layer)) return layer;
    throw UsageError("unknown layer '" + std::string(name)
                     + "'; there are direct, indirect, full and irradiance");
}

std::string layer_name(Layer layer) {
    switch (layer) {
    case Layer::direct:
        return "direct";
    case Layer::indirect:
        return "indirect";
    case Layer::full:
        return "full";
    case Layer::irradiance:
        return "irradiance";
    }
    return {};
}

PictureEstimate render_reference(const Surface& surface, const Spotlight& light,
                                 const Camera& camera, Layer layer,
                                 const PathTracerOptions& options) {
    constexpr std::uint64_t jitter_dimension = 0x70697865; // beyond any bounce of a path
    const Index pixel_count = static_cast<Index>(camera.width) * camera.height;
    const bool wants_direct = layer == Layer::direct || layer == Layer::full;
    const bool wants_indirect = layer != Layer::direct;

    const PathTracer tracer(surface, {&light, 1}, options.strategy);
    const Sampler sampler = [&](Index item, std::uint64_t seed, Index first, Index count,
                                std::span<Eigen::Array3d> sums) {
        const auto left = static_cast<float>(item % camera.width);
        const auto top = static_cast<float>(item / camera.width);
        std::array<Ray, block_size> rays;
        std::array<Hit, block_size> hits;
        std::array<PathStart, block_size> starts;
        PathTracer::Workspace work;
        std::uint64_t ray_count = 0;
        for (Index done = 0; done < count;) {
            std::array<std::uint32_t, block_size> index;
            std::size_t used = 0;
            for (; used < block_size && done < count; ++used, ++done) {
                index[used] = static_cast<std::uint32_t>(first + done);
                const Vec2 jitter = shuffled_sobol2(index[used], hash64(seed, jitter_dimension));
                rays[used] = {camera.position,
                              camera.direction(left + jitter.x(), top + jitter.y())};
            }
            surface.closest_hits({rays.data(), used}, {hits.data(), used});
            ray_count += used;
            std::size_t seen = 0;
            for (std::size_t k = 0; k < used; ++k) {
                if (!hits[k]) continue;
                const Rgb weight =
                    layer == Layer::irradiance
                        ? Rgb(Rgb::Ones())
                        : Rgb(surface.reflectance(hits[k]) / static_cast<float>(EIGEN_PI));
                const SurfacePoint x = surface.point(hits[k]);
                const Vec3 shown = surface.shown_normal(hits[k], x);
                starts[seen++] = {x, shown, weight, index[k]};
                if (!wants_direct) continue;
                ++ray_count;
                sums[0] += (weight * direct_irradiance(surface, light, x, shown)).cast<double>();
            }
            if (wants_indirect) ray_count += tracer.trace(seed, {starts.data(), seen}, sums, work);
        }
        return ray_count;
    };

    // Errors are stated over the pixels that see something, the estimator knows all of them.
    const Index covered = parallel_sum(pixel_count, Index{0}, [&](Index k) -> Index {
        const Vec3 direction = camera.direction(static_cast<float>(k % camera.width) + 0.5f,
                                                static_cast<float>(k / camera.width) + 0.5f);
        return surface.closest_hit({camera.position, direction}) ? 1 : 0;
    });
    const double to_all = std::sqrt(static_cast<double>(pixel_count)
                                    / static_cast<double>(std::max<Index>(1, covered)));
    EstimatorOptions all = estimator_options(options);
    all.target_error *= to_all;
    const MeanEstimate means = estimate_means(pixel_count, 1, sampler, all);

    PictureEstimate result;
    result.image = result.variance = Image(camera.width, camera.height);
    for (Index k = 0; k < pixel_count; ++k) {
        const auto x = static_cast<int>(k % camera.width), y = static_cast<int>(k / camera.width);
        result.image.set_pixel(x, y, means.mean.col(k));
        result.variance.set_pixel(x, y, means.standard_error.col(k).square());
    }
    result.relative_error = means.relative_error[0] / to_all;
    result.samples = means.samples;
    result.rays = means.rays;
    return result;
}

} // namespace afterglow
