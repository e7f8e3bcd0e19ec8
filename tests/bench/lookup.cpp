#include "tests/bench/lookup.h"

#include "basis/r_tree.h"
#include "core/sampling.h"
#include "core/seconds.h"
#include "transport/gather.h"
#include "transport/precompute.h"
#include "transport/sender_rows.h"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <unordered_map>
#include <utility>
#include <vector>

namespace afterglow {
namespace {

/// Each sphere in all cells that its box touches, in structure-of-arrays order within a cell: one look into
/// a table, then a straight loop.
class HashGrid {
public:
    HashGrid(const Eigen::Ref<const Eigen::Matrix3Xf>& centers, const Eigen::Ref<const Eigen::VectorXf>& radii, float cell)
        : inverse_cell_(1.0f / cell) {
        std::unordered_map<std::uint64_t, Range> range_of;
        for (int pass = 0; pass < 2; ++pass) { // counts, then places
            for (Index i = 0; i < radii.size(); ++i) {
                const std::array<int, 3> low = cell_of(centers.col(i).array() - radii[i]);
                const std::array<int, 3> high = cell_of(centers.col(i).array() + radii[i]);
                for (int x = low[0]; x <= high[0]; ++x)
                    for (int y = low[1]; y <= high[1]; ++y)
                        for (int z = low[2]; z <= high[2]; ++z) {
                            Range& range = range_of[key({x, y, z})];
                            if (pass == 1) {
                                const std::uint32_t at = range.begin + range.count;
                                for (int a = 0; a < 3; ++a) center_[a][at] = centers(a, i);
                                radius2_[at] = radii[i] * radii[i];
                            }
                            ++range.count;
                        }
            }
            if (pass == 1) break;
            std::uint32_t total = 0;
            for (auto& [cell_key, range] : range_of) {
                range.begin = total;
                total += std::exchange(range.count, 0);
            }
            for (auto& c : center_) c.resize(total);
            radius2_.resize(total);
        }
        table_.resize(std::bit_ceil(2 * range_of.size()));
        for (const auto& [cell_key, range] : range_of) {
            std::size_t at = slot(cell_key);
            while (table_[at].range.count > 0) at = (at + 1) & (table_.size() - 1);
            table_[at] = {cell_key, range};
        }
    }
    std::size_t bytes() const { return 16 * radius2_.size() + sizeof(Entry) * table_.size(); }

    template <class Visit>
    void containing(const Vec3& x, const Visit& visit) const {
        const std::uint64_t cell = key(cell_of(x.array()));
        std::size_t at = slot(cell);
        while (table_[at].range.count > 0 && table_[at].key != cell) at = (at + 1) & (table_.size() - 1);
        const Range range = table_[at].range; // an empty one where there is no such cell
        for (std::uint32_t k = range.begin; k < range.begin + range.count; ++k) {
            const float dx = x.x() - center_[0][k], dy = x.y() - center_[1][k], dz = x.z() - center_[2][k];
            const float d2 = dx * dx + dy * dy + dz * dz;
            if (d2 < radius2_[k]) visit(k, d2);
        }
    }

private:
    struct Range {
        std::uint32_t begin = 0, count = 0;
    };
    struct Entry {
        std::uint64_t key = 0;
        Range range;
    };
    float inverse_cell_;
    std::vector<Entry> table_; // by open addressing, half full at most
    std::array<std::vector<float>, 3> center_;
    std::vector<float> radius2_;

    std::array<int, 3> cell_of(const Eigen::Array3f& x) const {
        return {static_cast<int>(std::floor(x[0] * inverse_cell_)), static_cast<int>(std::floor(x[1] * inverse_cell_)),
                static_cast<int>(std::floor(x[2] * inverse_cell_))};
    }
    static std::uint64_t key(const std::array<int, 3>& c) {
        constexpr std::uint64_t mask = (1u << 21) - 1;
        return (static_cast<std::uint64_t>(c[0]) & mask) << 42 | (static_cast<std::uint64_t>(c[1]) & mask) << 21
               | (static_cast<std::uint64_t>(c[2]) & mask);
    }
    std::size_t slot(std::uint64_t cell) const { return hash64(cell) & (table_.size() - 1); }
};

/// Nanoseconds of one call at a place, the best of five rounds over all on one thread; `found`: of all places.
template <class At>
double nanoseconds(std::size_t places, double& found, const At& at) {
    double best = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 5; ++k) {
        found = 0.0;
        const auto start = std::chrono::steady_clock::now();
        for (std::size_t i = 0; i < places; ++i) found += at(i);
        best = std::min(best, 1e9 * seconds_since(start) / static_cast<double>(places));
    }
    return best;
}

} // namespace

void run_lookup(const std::string& name) {
    const Scene scene = load_scene(name);
    const Surface surface(scene);
    const TransferOperator transfer = precompute(surface, {});
    const PointHierarchy& points = transfer.points;
    const int level = transfer.sender_levels - 1;
    const Index begin = points.begin(level), count = points.end(level) - begin;
    const auto centers = points.position.middleCols(begin, count);
    const Eigen::VectorXf radii = points.support.segment(begin, count);

    // Some of what arrives at each level of receivers, in its order.
    const std::vector<Hit> all = arrivals(surface, points, 1);
    std::vector<Hit> hits;
    for (std::size_t i = 0, stride = all.size() / 1'000'000 + 1; i < all.size(); i += stride) hits.push_back(all[i]);
    std::vector<Vec3> places;
    for (const Hit& hit : hits) places.push_back(surface.point(hit).position);

    const RTree tree(centers, radii, 0);
    double found = 0.0;
    const double of_tree = nanoseconds(places.size(), found, [&](std::size_t i) {
        double sum = 0.0;
        tree.containing(places[i], [&](std::uint32_t, float d2) { sum += 1.0 + 0.0 * d2; });
        return sum;
    });
    std::printf("%u spheres, %zu places\nR-tree     %7.1f ns, %.2f found, %.1f MB\n", static_cast<unsigned>(count),
                places.size(), of_tree, found / static_cast<double>(places.size()), 1e-6 * static_cast<double>(tree.bytes()));
    for (const float share : {0.5f, 1.0f, 2.0f}) { // of the mean radius
        const HashGrid grid(centers, radii, share * radii.mean());
        const double of_grid = nanoseconds(places.size(), found, [&](std::size_t i) {
            double sum = 0.0;
            grid.containing(places[i], [&](std::uint32_t, float d2) { sum += 1.0 + 0.0 * d2; });
            return sum;
        });
        std::printf("hash grid  %7.1f ns, %.2f found, %.1f MB (cells %.1f of the mean radius)\n", of_grid,
                    found / static_cast<double>(places.size()), 1e-6 * static_cast<double>(grid.bytes()),
                    static_cast<double>(share));
    }

    const ShepardBasis basis(points, surface, true);
    std::vector<BasisEntry> row;
    const double of_basis = nanoseconds(places.size() / 10, found, [&](std::size_t i) {
        row.clear();
        sender_row(surface, basis, level, hits[10 * i], row);
        return static_cast<double>(row.size());
    });
    std::printf("whole row  %7.1f ns, %.2f entries, by the R-tree, with openness, walls and reflectance\n", of_basis,
                found / static_cast<double>(places.size() / 10));
    SenderRows rows(surface, basis, transfer.sender_levels);
    rows.see(all);
    std::vector<std::uint32_t> numbers;
    for (const Hit& hit : hits) numbers.push_back(rows.number(hit, level));
    rows.require(numbers);
    const double of_patch = nanoseconds(places.size(), found, [&](std::size_t i) {
        double sum = 0.0;
        for (const BasisEntry& entry : rows.row(rows.number(hits[i], level))) sum += 1.0 + 0.0 * entry.value;
        return sum;
    });
    std::printf("its patch  %7.1f ns, %.2f entries\n", of_patch, found / static_cast<double>(places.size()));
}

} // namespace afterglow
