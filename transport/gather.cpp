#include "transport/gather.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

namespace afterglow {
namespace {

/// Interleaves the leading four bits of both coordinates: similar directions, similar keys.
std::uint32_t direction_key(const std::array<std::uint32_t, 2>& u) {
    std::uint32_t key = 0;
    for (int b = 0; b < 4; ++b)
        key |= ((u[0] >> (28 + b)) & 1u) << (2 * b) | ((u[1] >> (28 + b)) & 1u) << (2 * b + 1);
    return key;
}

} // namespace

GatherDirections::GatherDirections(int rays, std::uint64_t seed) {
    for (int k = 0; k < rays; ++k) sobol_.push_back(sobol2(static_cast<std::uint32_t>(k)));
    const std::uint64_t h = hash64(seed, 0x6a7e);
    shift_ = {static_cast<std::uint32_t>(h), static_cast<std::uint32_t>(h >> 32)};
}

void GatherDirections::deal(Index receiver, int first, Eigen::Matrix3Xf& directions) const {
    // Sobol is linear over GF(2): point i N + k is point i N XOR point k where N is a power of two.
    const auto start = sobol2(static_cast<std::uint32_t>(receiver * rays()));
    const std::array<std::uint32_t, 2> mask{start[0] ^ shift_[0], start[1] ^ shift_[1]};
    // Counting sort by key.
    const auto points = std::span(sobol_).subspan(static_cast<std::size_t>(first),
                                                  static_cast<std::size_t>(directions.cols()));
    std::array<std::uint16_t, 257> place{};
    std::array<std::uint32_t, 2> u;
    for (const auto& s : points) {
        u = {s[0] ^ mask[0], s[1] ^ mask[1]};
        ++place[direction_key(u) + 1];
    }
    for (int k = 0; k < 256; ++k) place[k + 1] += place[k];
    for (const auto& s : points) {
        u = {s[0] ^ mask[0], s[1] ^ mask[1]};
        directions.col(place[direction_key(u)]++)
            = sample_vector_irradiance({unit_float(u[0]), unit_float(u[1])});
    }
}

namespace {

constexpr std::uint32_t golden_ratio = 2654435769u; // its fraction of 2^32

/// Traces these rays of the receivers, points of a level that begins with first_receiver, and calls
/// visit(r, local, rays, hits) for receivers[r].
template <class Visit>
void trace(const Surface& surface, const PointHierarchy& points, std::span<const std::uint32_t> receivers,
           Index first_receiver, const GatherDirections& directions, RayRange range, const Visit& visit) {
    parallel_ranges(static_cast<Index>(receivers.size()), 16, [&](Index begin, Index end) {
        Eigen::Matrix3Xf local(3, range.count);
        std::vector<Ray> rays(range.count);
        std::vector<Hit> hits(range.count);
        for (Index r = begin; r < end; ++r) {
            const SurfacePoint x = points.point(receivers[r]);
            const Frame frame(x.normal);
            const Vec3 origin = surface.lifted(x);
            directions.deal(receivers[r] - first_receiver, range.first, local);
            for (int k = 0; k < range.count; ++k)
                rays[k] = {origin, frame.to_world(local.col(k))};
            surface.closest_hits(rays, hits);
            visit(r, local, rays, hits);
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
        std::vector<std::uint32_t> receivers(points.end(l) - points.begin(l));
        std::iota(receivers.begin(), receivers.end(), points.begin(l));
        trace(surface, points, receivers, points.begin(l),
              GatherDirections(rays, hash64(seed, 0xa4400 + static_cast<std::uint64_t>(l))), {0, rays},
              [&](Index r, const Eigen::Matrix3Xf&, const std::vector<Ray>&,
                  const std::vector<Hit>& hits) {
                  std::copy(hits.begin(), hits.end(),
                            all.begin() + static_cast<std::ptrdiff_t>(first) + r * rays);
              });
    }
    std::erase_if(all, [](const Hit& hit) { return !hit; });
    return all;
}

void trace_gather(const Surface& surface, const SenderRows& rows, const PointHierarchy& points,
                  std::span<const std::uint32_t> receivers, Index first_receiver,
                  const GatherDirections& directions, RayRange range, const Footprint& footprint,
                  std::span<GatherSample> samples) {
    const int all = directions.rays();
    trace(surface, points, receivers, first_receiver, directions, range,
          [&](Index r, const Eigen::Matrix3Xf& local, const std::vector<Ray>& rays,
              const std::vector<Hit>& hits) {
              GatherSample* sample = &samples[static_cast<std::size_t>(r * all + range.first)];
              for (int k = 0; k < range.count; ++k) {
                  const float pdf = vector_irradiance_pdf(local(2, k));
                  sample[k].weight = rays[k].direction / (static_cast<float>(EIGEN_PI) * pdf * all);
                  sample[k].row = no_index;
                  if (!hits[k]) continue;
                  const float level = footprint.level(hits[k]);
                  const float coarser = std::floor(level);
                  // Between two levels, one of them: a sequence of its own decides.
                  const auto n = static_cast<std::uint32_t>((receivers[r] - first_receiver) * all
                                                            + range.first + k);
                  const bool finer = unit_float(n * golden_ratio) < level - coarser;
                  sample[k].row = rows.number(hits[k], static_cast<int>(coarser) + finer);
              }
          });
}

} // namespace afterglow
