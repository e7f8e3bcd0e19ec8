#include "transport/gather.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <cmath>
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

void GatherDirections::deal(Index receiver, Eigen::Matrix3Xf& directions) const {
    // Sobol is linear over GF(2): point i N + k is point i N XOR point k where N is a power of two.
    const auto first = sobol2(static_cast<std::uint32_t>(receiver * rays()));
    const std::array<std::uint32_t, 2> mask{first[0] ^ shift_[0], first[1] ^ shift_[1]};
    // Counting sort by key.
    std::array<std::uint16_t, 257> place{};
    std::array<std::uint32_t, 2> u;
    for (const auto& s : sobol_) {
        u = {s[0] ^ mask[0], s[1] ^ mask[1]};
        ++place[direction_key(u) + 1];
    }
    for (int k = 0; k < 256; ++k) place[k + 1] += place[k];
    directions.resize(3, rays());
    for (const auto& s : sobol_) {
        u = {s[0] ^ mask[0], s[1] ^ mask[1]};
        directions.col(place[direction_key(u)]++)
            = sample_vector_irradiance({unit_float(u[0]), unit_float(u[1])});
    }
}

void trace_gather(const Surface& surface, SenderRows& rows, const PointHierarchy& points,
                  Index begin, Index end, Index first_receiver, const GatherDirections& directions,
                  const Footprint& footprint, std::vector<GatherSample>& samples) {
    const int rays = directions.rays();
    samples.resize(static_cast<std::size_t>(end - begin) * rays);
    parallel_ranges(end - begin, 16, [&](Index first, Index last) {
        Eigen::Matrix3Xf local;
        std::vector<Ray> ray(rays);
        std::vector<Hit> hit(rays);
        for (Index r = first; r < last; ++r) {
            const SurfacePoint x = points.point(begin + r);
            const Frame frame(x.normal);
            const Vec3 origin = surface.lifted(x);
            directions.deal(begin + r - first_receiver, local);
            for (int k = 0; k < rays; ++k) ray[k] = {origin, frame.to_world(local.col(k))};
            surface.closest_hits(ray, hit);
            GatherSample* sample = &samples[static_cast<std::size_t>(r) * rays];
            for (int k = 0; k < rays; ++k) {
                const float pdf = vector_irradiance_pdf(local(2, k));
                sample[k].weight = ray[k].direction / (static_cast<float>(EIGEN_PI) * pdf * rays);
                sample[k].finer_share = 0.0f;
                sample[k].row = sample[k].finer_row = no_index;
                if (!hit[k]) continue;
                if (k % 4 == 0) rows.count(hit[k]);
                const float at = footprint.level(hit[k]);
                const int level = static_cast<int>(at);
                sample[k].row = rows.number(hit[k], level);
                if (at == static_cast<float>(level)) continue;
                sample[k].finer_share = at - static_cast<float>(level);
                sample[k].finer_row = rows.number(hit[k], level + 1);
            }
        }
    });
}

} // namespace afterglow
