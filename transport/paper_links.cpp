#include "transport/paper_links.h"

#include "core/parallel.h"
#include "core/sampling.h"
#include "transport/accumulator.h"
#include "transport/gather.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <span>

namespace afterglow {
namespace {

using Row = std::vector<SparseEntry<RgbLink>>;
using Clock = std::chrono::steady_clock;

RgbLink outer(const Vec3& direction, const Rgb& colour) {
    RgbLink link;
    for (int axis = 0; axis < 3; ++axis)
        link.segment<3>(3 * axis) = direction[axis] * colour;
    return link;
}

/// For each function of a level, the others of the level that have its support over their centres.
std::vector<std::vector<std::uint32_t>> neighbours_of(const ShepardBasis& basis, int levels) {
    const PointHierarchy& points = basis.points();
    std::vector<std::vector<std::uint32_t>> neighbours(points.end(levels - 1));
    std::vector<BasisEntry> row;
    for (int l = 0; l < levels; ++l)
        for (std::uint32_t k = points.begin(l); k < points.end(l); ++k) {
            row.clear();
            basis.evaluate(l, points.point(k), row);
            for (const BasisEntry& entry : row)
                if (entry.index != k) neighbours[entry.index].push_back(k);
        }
    return neighbours;
}

/// What a thread needs to gather one receiver after the other.
class Gatherer {
public:
    Gatherer(const Surface& surface, const ShepardBasis& basis, int sender_levels,
             const std::vector<std::vector<std::uint32_t>>& neighbours, float threshold)
        : surface_(surface), basis_(basis), points_(basis.points()), sender_levels_(sender_levels),
          neighbours_(neighbours), threshold_(threshold),
          link_(points_.end(sender_levels - 1), RgbLink::Zero()) {}

    /// The links of receiver i that are kept; `done` has the rows of the coarser levels.
    Row gather(std::uint32_t i, int level, const GatherDirections& directions,
               const std::vector<Row>& done, std::uint64_t& links_before) {
        cast_rays(i, i - points_.begin(level), directions);
        subtract_coarser(points_.point(i), level, done);
        Row kept;
        link_.for_each(0, points_.end(sender_levels_ - 1),
                       [&](std::uint32_t j, const RgbLink& value) {
                           const float size = magnitude(value);
                           links_before += size > 0.0f;
                           if (size > threshold_ && varies(j, value)) kept.push_back({j, value});
                       });
        link_.clear();
        return kept;
    }

private:
    void cast_rays(std::uint32_t i, Index place_in_level, const GatherDirections& directions) {
        const SurfacePoint x = points_.point(i);
        const Frame frame(x.normal);
        directions.deal(place_in_level, local_);
        const Index count = local_.cols();
        rays_.resize(static_cast<std::size_t>(count));
        hits_.resize(rays_.size());
        for (Index k = 0; k < count; ++k)
            rays_[k] = {surface_.lifted(x), frame.to_world(local_.col(k))};
        surface_.closest_hits(rays_, hits_);
        for (Index k = 0; k < count; ++k) {
            if (!hits_[k]) continue;
            const float density = static_cast<float>(EIGEN_PI) * vector_irradiance_pdf(local_(2, k))
                                  * static_cast<float>(count);
            const RgbLink arriving =
                outer(rays_[k].direction / density, surface_.reflectance(hits_[k]));
            const SurfacePoint y = surface_.point(hits_[k]);
            seen_.clear();
            for (int l = 0; l < sender_levels_; ++l)
                basis_.evaluate(l, y, seen_);
            for (const BasisEntry& entry : seen_)
                link_.at(entry.index) += entry.value * arriving;
        }
    }

    void subtract_coarser(const SurfacePoint& x, int level, const std::vector<Row>& done) {
        seen_.clear();
        for (int l = 0; l < level; ++l)
            basis_.evaluate(l, x, seen_);
        for (const BasisEntry& coarser : seen_)
            for (const auto& link : done[coarser.index])
                link_.at(link.index) -= coarser.value * link.value;
    }

    bool varies(std::uint32_t j, const RgbLink& value) {
        if (j < points_.end(0) || neighbours_[j].empty()) return true;
        return std::any_of(neighbours_[j].begin(), neighbours_[j].end(), [&](std::uint32_t k) {
            return magnitude(value - link_.at(k)) > threshold_;
        });
    }

    const Surface& surface_;
    const ShepardBasis& basis_;
    const PointHierarchy& points_;
    int sender_levels_;
    const std::vector<std::vector<std::uint32_t>>& neighbours_;
    float threshold_;
    Accumulator<RgbLink> link_;
    Eigen::Matrix3Xf local_;
    std::vector<Ray> rays_;
    std::vector<Hit> hits_;
    std::vector<BasisEntry> seen_;
};

} // namespace

RgbLinks make_paper_links(const Surface& surface, const ShepardBasis& basis, int sender_levels,
                          const LinkOptions& options, LinkStatistics& statistics) {
    const auto start = Clock::now();
    const PointHierarchy& points = basis.points();
    statistics.threshold = options.threshold.value();
    const auto neighbours = neighbours_of(basis, sender_levels);
    ScratchPool<Gatherer> gatherers([&] {
        return std::make_unique<Gatherer>(surface, basis, sender_levels, neighbours,
                                          statistics.threshold);
    });
    std::vector<Row> done(points.size());
    for (int l = 0; l < points.levels(); ++l) {
        const GatherDirections directions(options.rays,
                                          hash64(options.seed, static_cast<std::uint64_t>(l)));
        const Index count = points.end(l) - points.begin(l);
        constexpr Index grain = 16;
        struct Count {
            std::uint64_t before = 0, gathered = 0;
        };
        std::vector<Count> counts(static_cast<std::size_t>((count + grain - 1) / grain));
        parallel_ranges(count, grain, [&](Index first, Index last) {
            const auto gatherer = gatherers.borrow();
            Count& c = counts[static_cast<std::size_t>(first / grain)];
            std::vector<BasisEntry> parents;
            for (Index r = first; r < last; ++r) {
                const std::uint32_t i = points.begin(l) + static_cast<std::uint32_t>(r);
                parents.clear();
                if (l > 0) basis.evaluate(l - 1, points.point(i), parents);
                const bool active =
                    parents.empty()
                    || std::any_of(parents.begin(), parents.end(), [&](const BasisEntry& parent) {
                           return !done[parent.index].empty();
                       });
                if (!active) continue;
                done[i] = gatherer->gather(i, l, directions, done, c.before);
                ++c.gathered;
            }
        });
        for (const Count& c : counts) {
            statistics.links_before += c.before;
            statistics.rays += c.gathered * static_cast<std::uint64_t>(options.rays);
        }
        if (options.progress) options.progress(static_cast<double>(points.end(l)) / points.size());
    }
    RgbLinks links = join_rows(std::move(done));
    statistics.links_seconds +=
        std::chrono::duration<double>(Clock::now() - start).count();
    return links;
}

} // namespace afterglow
