#include "transport/display.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <vector>

namespace afterglow {
namespace {

/// n . sum_j B_j V_j.
Rgb dot_with(const Vec3& normal, const VectorIrradiance& field, std::span<const BasisEntry> row) {
    Rgb sum = Rgb::Zero();
    for (const BasisEntry& entry : row) sum += entry.value * net_irradiance(field, entry.index, normal);
    return sum;
}

} // namespace

Display::Display(const TransferOperator& transfer, const Surface& surface)
    : transfer_(transfer), surface_(surface),
      basis_(transfer.points, surface, transfer.kind == OperatorKind::neumann,
             transfer.kind == OperatorKind::neumann ? std::optional(transfer.points.levels() - 1)
                                                    : std::nullopt) {}

Rgb Display::net_irradiance(const SurfacePoint& x, const Vec3& normal,
                            const VectorIrradiance& field, bool& covered) const {
    thread_local std::vector<BasisEntry> row;
    row.clear();
    const int last = transfer_.points.levels() - 1;
    if (transfer_.kind == OperatorKind::neumann)
        basis_.evaluate_or_nearest(last, x, row);
    else
        for (int l = 0; l <= last; ++l)
            basis_.evaluate(l, x, row);
    covered = !row.empty();
    return dot_with(normal, field, row);
}

Rgb Display::gather(const SurfacePoint& x, const Vec3& shown, const VectorIrradiance& field,
                    const Spotlight& light, int paths) const {
    constexpr int most_vertices = 32;
    const int last = transfer_.points.levels() - 1;
    const Falloff falloff(light);
    const Frame frame(shown);
    std::uint64_t seed = 0; // of the place, so that the samples of a pixel do not share their errors
    for (const float coordinate : x.position)
        seed = hash64(seed, std::bit_cast<std::uint32_t>(coordinate));
    thread_local std::vector<BasisEntry> row;
    Rgb sum = Rgb::Zero();
    for (int k = 0; k < paths; ++k) {
        Rng rng(seed, static_cast<std::uint64_t>(k));
        Rgb throughput = Rgb::Ones();
        SurfacePoint y = x;
        Vec3 direction = frame.to_world(sample_cosine(scrambled_sobol2(static_cast<std::uint32_t>(k), seed)));
        for (int vertex = 0; vertex < most_vertices; ++vertex) {
            // Above the horizon of a normal map's normal, a direction may lie below the surface.
            if (direction.dot(y.normal) <= 0.0f) break;
            const Hit hit = surface_.closest_hit({surface_.lifted(y), direction});
            if (!hit) break;
            y = surface_.point(hit);
            throughput *= surface_.reflectance(hit);
            const Rgb direct = unoccluded_irradiance(light, falloff, y);
            if ((direct > 0.0f).any() && !surface_.blocked(surface_.lifted(y), light.position))
                sum += throughput * direct;
            if (!basis_.roofed(last, y)) {
                row.clear();
                basis_.closest_in_sight(last, y, row);
                sum += throughput * dot_with(y.normal, field, row).max(0.0f);
                break;
            }
            const float u = rng.uniform();
            direction = Frame(y.normal).to_world(sample_cosine({u, rng.uniform()}));
        }
    }
    return sum / static_cast<float>(paths);
}

Rgb Display::irradiance(const SurfacePoint& x, const Vec3& shown, const VectorIrradiance& field,
                        const Spotlight& light, bool& covered, int gap_paths) const {
    const bool in_gap = gap_paths > 0 && transfer_.kind == OperatorKind::neumann
                        && basis_.in_gap(transfer_.points.levels() - 1, x);
    if (!in_gap) return net_irradiance(x, shown, field, covered).max(0.0f);
    covered = true;
    return gather(x, shown, field, light, gap_paths);
}

Eigen::Array3Xf Display::irradiance(std::span<const SurfacePoint> places,
                                    const VectorIrradiance& field, const Spotlight& light,
                                    Index* uncovered) const {
    Eigen::Array3Xf result(3, static_cast<Index>(places.size()));
    std::vector<std::uint8_t> is_uncovered(places.size());
    parallel_for(result.cols(), [&](Index p) {
        const auto i = static_cast<std::size_t>(p);
        bool covered = false;
        result.col(p) = irradiance(places[i], places[i].normal, field, light, covered);
        is_uncovered[i] = !covered;
    });
    if (uncovered) *uncovered = std::count(is_uncovered.begin(), is_uncovered.end(), 1);
    return result;
}

} // namespace afterglow
