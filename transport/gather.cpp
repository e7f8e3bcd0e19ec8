#include "transport/gather.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace afterglow {
namespace {

/// Which of `cells` (a power of two) a point of the square lies in, cells counted in Morton order.
std::size_t morton_cell(const std::array<std::uint32_t, 2>& u, std::size_t cells) {
    std::size_t cell = 0;
    int next = 31;
    for (int c = 1; cells > 1; cells /= 2, c = 1 - c) {
        cell = cell << 1 | ((u[c] >> next) & 1u);
        next -= c == 0;
    }
    return cell;
}

} // namespace

GatherDirections::GatherDirections(int rays, std::uint64_t seed) : sobol_(static_cast<std::size_t>(rays)) {
    // A (0, 2)-sequence: each of so many cells holds one of its points.
    for (int k = 0; k < rays; ++k) {
        const auto u = sobol2(static_cast<std::uint32_t>(k));
        sobol_[morton_cell(u, sobol_.size())] = u;
    }
    const std::uint64_t h = hash64(seed, 0x6a7e);
    shift_ = {static_cast<std::uint32_t>(h), static_cast<std::uint32_t>(h >> 32)};
}

void GatherDirections::deal(Index receiver, Eigen::Matrix3Xf& directions) const {
    // Sobol is linear over GF(2): point i N + k is point i N XOR point k where N is a power of two; and so are
    // the cells.
    const auto start = sobol2(static_cast<std::uint32_t>(receiver * rays()));
    const std::array<std::uint32_t, 2> mask{start[0] ^ shift_[0], start[1] ^ shift_[1]};
    const std::size_t cell = morton_cell(mask, sobol_.size());
    directions.resize(3, rays());
    for (std::size_t k = 0; k < sobol_.size(); ++k) {
        const std::array<std::uint32_t, 2>& s = sobol_[k ^ cell];
        directions.col(static_cast<Index>(k)) =
            sample_vector_irradiance({unit_float(s[0] ^ mask[0]), unit_float(s[1] ^ mask[1])});
    }
}

namespace {

constexpr int coherent_rays = 1024; // of so many a receiver, eight neighbours are close
constexpr std::uint32_t golden_ratio = 2654435769u; // its fraction of 2^32

/// Traces the rays of the receivers [begin, end), points of a level that begins with level_begin, and calls
/// visit(i, local, rays, hits).
template <class Visit>
void trace(const Surface& surface, const PointHierarchy& points, Index begin, Index end, Index level_begin,
           const GatherDirections& directions, const Visit& visit) {
    const int count = directions.rays();
    parallel_ranges(end - begin, 16, [&](Index first, Index last) {
        Eigen::Matrix3Xf local;
        std::vector<Ray> rays(count);
        std::vector<Hit> hits(count);
        for (Index i = begin + first; i < begin + last; ++i) {
            const SurfacePoint x = points.point(i);
            const Frame frame(x.normal);
            const Vec3 origin = surface.lifted(x);
            directions.deal(i - level_begin, local);
            for (int k = 0; k < count; ++k)
                rays[k] = {origin, frame.to_world(local.col(k))};
            surface.closest_hits(rays, hits, count >= coherent_rays);
            visit(i, local, rays, hits);
        }
    });
}

} // namespace

std::vector<Hit> arrivals(const Surface& surface, const PointHierarchy& points,
                          std::uint64_t seed) {
    constexpr int rays = 8;
    std::vector<Hit> all;
    for (int l = 0; l < points.levels(); ++l) {
        if (!points.leads_to_display(l)) continue;
        const std::size_t first = all.size();
        all.resize(first + static_cast<std::size_t>(points.end(l) - points.begin(l)) * rays);
        trace(surface, points, points.begin(l), points.end(l), points.begin(l),
              GatherDirections(rays, hash64(seed, 0xa4400 + static_cast<std::uint64_t>(l))),
              [&](Index i, const Eigen::Matrix3Xf&, const std::vector<Ray>&,
                  const std::vector<Hit>& hits) {
                  std::copy(hits.begin(), hits.end(),
                            all.begin() + static_cast<std::ptrdiff_t>(first) + (i - points.begin(l)) * rays);
              });
    }
    std::erase_if(all, [](const Hit& hit) { return !hit; });
    return all;
}

void trace_gather(const Surface& surface, const SenderRows& rows, const PointHierarchy& points, Index begin,
                  Index level_begin, const GatherDirections& directions, const Footprint& footprint,
                  std::span<GatherSample> samples) {
    const int count = directions.rays();
    trace(surface, points, begin, begin + static_cast<Index>(samples.size()) / count, level_begin, directions,
          [&](Index i, const Eigen::Matrix3Xf& local, const std::vector<Ray>& rays,
              const std::vector<Hit>& hits) {
              GatherSample* sample = &samples[static_cast<std::size_t>((i - begin) * count)];
              for (int k = 0; k < count; ++k) {
                  const float pdf = vector_irradiance_pdf(local(2, k));
                  sample[k].weight = rays[k].direction / (static_cast<float>(EIGEN_PI) * pdf * count);
                  sample[k].row = no_index;
                  if (!hits[k]) continue;
                  const float level = footprint.level(hits[k]);
                  const float coarser = std::floor(level);
                  // Between two levels, one of them: a sequence of its own decides.
                  const auto n = static_cast<std::uint32_t>((i - level_begin) * count + k);
                  const bool finer = unit_float(n * golden_ratio) < level - coarser;
                  sample[k].row = rows.number(hits[k], static_cast<int>(coarser) + finer);
              }
          });
}

} // namespace afterglow
