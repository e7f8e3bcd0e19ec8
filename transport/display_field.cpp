#include "transport/display_field.h"

#include "core/parallel.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

namespace afterglow {
namespace {

/// As many neighbours in a row of pixels as are read at once, and one number of each.
constexpr int lane_count = 8;
using Lanes = Eigen::Array<float, lane_count, 1>;

/// Pixels of one patch, component by component; those beyond `count` repeat the last.
struct Run {
    std::array<Lanes, 3> position, normal, shading_normal;

    Run(const PixelSurfaces& pixels, std::span<const PixelSurfaces::Float4> shading,
        std::size_t first, int count) {
        for (int k = 0; k < lane_count; ++k) {
            const std::size_t p = first + static_cast<std::size_t>(std::min(k, count - 1));
            for (int a = 0; a < 3; ++a) {
                position[a][k] = pixels.position[p][a];
                normal[a][k] = pixels.normal[p][a];
                shading_normal[a][k] = shading[p][a];
            }
        }
    }
};

Lanes dot(const std::array<Lanes, 3>& a, const std::array<float, 3>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Squared share of the support at which places lie, with the squashed distance, and the cosine
/// between the normals.
struct Relation {
    Lanes d2, cosine;
    Relation(const Run& x, const DisplayFunction& f) {
        const std::array<Lanes, 3> d = {x.position[0] - f.position[0], x.position[1] - f.position[1],
                                        x.position[2] - f.position[2]};
        const Lanes h = dot(d, f.normal);
        d2 = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + 8.0f * h * h) / (f.support * f.support);
        cosine = dot(x.normal, f.normal);
    }
    /// K(d) max(0, n . n_j)^p.
    Lanes weight(int power) const {
        const Lanes inside = d2.min(1.0f);
        const Lanes kernel = (2.0f * inside.sqrt() - 3.0f) * inside + 1.0f;
        Lanes result = kernel.max(0.0f);
        for (Lanes base = cosine.max(0.0f); power > 0; power >>= 1, base *= base)
            if (power & 1) result *= base;
        return result;
    }
};

/// n . V of each colour.
std::array<Lanes, 3> irradiance_of(const Run& x, const DisplayFunction& f) {
    const std::array<float, 9>& v = f.vector_irradiance;
    return {dot(x.shading_normal, {v[0], v[3], v[6]}), dot(x.shading_normal, {v[1], v[4], v[7]}),
            dot(x.shading_normal, {v[2], v[5], v[8]})};
}

} // namespace

DisplayField::DisplayField(const PointHierarchy& points)
    : first_(points.begin(points.levels() - 1)), weight_power_(points.shape.weight_power),
      functions_(points.size() - first_) {
    for (std::size_t k = 0; k < functions_.size(); ++k) {
        const auto j = static_cast<Index>(first_ + k);
        Eigen::Vector3f::Map(functions_[k].position.data()) = points.position.col(j);
        Eigen::Vector3f::Map(functions_[k].normal.data()) = points.normal.col(j);
        functions_[k].support = points.support[j];
    }
}

void DisplayField::set(const VectorIrradiance& field) {
    parallel_for(static_cast<Index>(functions_.size()), [&](Index k) {
        std::copy_n(&field[9 * static_cast<std::size_t>(first_ + k)], 9,
                    functions_[static_cast<std::size_t>(k)].vector_irradiance.begin());
    }, 4096);
}

void DisplayField::irradiance(const PixelSurfaces& pixels, const DisplayPatches& patches,
                              std::span<const std::uint32_t> patch,
                              std::span<const PixelSurfaces::Float4> shading_normal,
                              std::span<PixelSurfaces::Float4> result) const {
    const auto read = [&](std::size_t first, int count) {
        const std::span<const BasisEntry> functions = patches.functions(patch[first]);
        if (functions.empty()) return;
        const Run x(pixels, shading_normal, first, count);
        std::array<Lanes, 3> sum = {Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
        Lanes weights = Lanes::Zero();
        for (const BasisEntry& entry : functions) {
            const DisplayFunction& f = functions_[entry.index - first_];
            const Lanes w = entry.value * Relation(x, f).weight(weight_power_);
            const std::array<Lanes, 3> e = irradiance_of(x, f);
            for (int c = 0; c < 3; ++c) sum[c] += w * e[c];
            weights += w;
        }
        if ((weights <= 0.0f).any()) { // there, the closest has it all
            Lanes least = Lanes::Constant(std::numeric_limits<float>::infinity());
            const auto nowhere = (weights <= 0.0f).eval();
            for (const BasisEntry& entry : functions) {
                const DisplayFunction& f = functions_[entry.index - first_];
                const Lanes d2 = Relation(x, f).d2;
                const auto closer = (nowhere && d2 < least).eval();
                const std::array<Lanes, 3> e = irradiance_of(x, f);
                for (int c = 0; c < 3; ++c) sum[c] = closer.select(e[c], sum[c]);
                least = closer.select(d2, least);
            }
            weights = nowhere.select(Lanes::Ones(), weights);
        }
        for (Lanes& s : sum) s = (s / weights).max(0.0f);
        for (int k = 0; k < count; ++k)
            result[first + static_cast<std::size_t>(k)] = {sum[0][k], sum[1][k], sum[2][k], 1.0f};
    };
    parallel_ranges(static_cast<Index>(patch.size()), 4096, [&](Index begin, Index end) {
        const auto last = static_cast<std::size_t>(end);
        for (auto p = static_cast<std::size_t>(begin); p < last;) {
            std::size_t next = p + 1;
            while (next < std::min(last, p + lane_count) && patch[next] == patch[p]) ++next;
            std::fill(result.begin() + static_cast<std::ptrdiff_t>(p),
                      result.begin() + static_cast<std::ptrdiff_t>(next), PixelSurfaces::Float4{});
            if (patch[p] != no_index) read(p, static_cast<int>(next - p));
            p = next;
        }
    });
}

} // namespace afterglow
