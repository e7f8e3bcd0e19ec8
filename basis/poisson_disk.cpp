#include "basis/poisson_disk.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

namespace afterglow {
namespace {

struct Dart {
    SurfacePoint at;
    std::size_t candidate;
    Openness openness;
};

struct Cell {
    std::array<std::int32_t, 27> neighbour; // itself included; -1 where nothing is
    int parity;                             // cells of equal parity never touch
    std::vector<Dart> darts;
    std::vector<std::uint32_t> waiting;     // candidates of this round, by place in the round
};

using CellKey = std::array<std::int32_t, 3>;

/// From the place of a cell to its number: open addressing, one cache line a look.
class CellIndex {
public:
    /// -1 where there is none.
    std::int32_t find(const CellKey& key) const {
        for (std::size_t k = hash(key);; ++k) {
            const Slot& slot = slots_[k & (slots_.size() - 1)];
            if (slot.id < 0 || slot.key == key) return slot.id;
        }
    }
    /// The key must be new.
    void insert(const CellKey& key, std::int32_t id) {
        if (2 * ++used_ > slots_.size()) {
            std::vector<Slot> old(2 * slots_.size());
            old.swap(slots_);
            for (const Slot& slot : old)
                if (slot.id >= 0) put(slot);
        }
        put({key, id});
    }

private:
    struct Slot {
        CellKey key{};
        std::int32_t id = -1;
    };
    std::vector<Slot> slots_ = std::vector<Slot>(1024);
    std::size_t used_ = 0;

    static std::size_t hash(const CellKey& k) {
        return hash64(static_cast<std::uint64_t>(static_cast<std::uint32_t>(k[0])) << 32
                          | static_cast<std::uint32_t>(k[1]),
                      static_cast<std::uint32_t>(k[2]));
    }
    void put(const Slot& slot) {
        std::size_t k = hash(slot.key);
        while (slots_[k & (slots_.size() - 1)].id >= 0) ++k;
        slots_[k & (slots_.size() - 1)] = slot;
    }
};

class DartBoard {
public:
    DartBoard(const Surface& surface, const PoissonDiskOptions& options)
        : surface_(surface), options_(options),
          probe_(surface, options.spacing) {}

    /// Throws the candidates [begin, end) of the source; accepted[i] tells of begin + i.
    /// `refining`: the openness feature may add points closer than R.
    void throw_darts(const CandidateSource& source, std::size_t begin, std::size_t end, bool refining,
                     std::vector<char>& accepted) {
        const std::size_t count = end - begin;
        accepted.assign(count, 0);
        std::vector<std::optional<Openness>> features(count);
        // Most conflict with darts of earlier rounds already, in whatever order they are looked at.
        std::vector<char> fits_so_far(count);
        parallel_for(static_cast<Index>(count), [&](Index i) {
            const SurfacePoint& x = source[begin + i].at;
            const std::int32_t cell = index_.find(key_of(x.position));
            fits_so_far[i] = cell < 0 || fits(cells_[cell], x, refining, features[i]);
        });
        std::array<std::vector<std::int32_t>, 8> classes;
        for (std::size_t i = 0; i < count; ++i) {
            if (!fits_so_far[i]) continue;
            const std::int32_t id = cell_of(source[begin + i].at.position);
            Cell& cell = cells_[id];
            if (cell.waiting.empty()) classes[cell.parity].push_back(id);
            cell.waiting.push_back(static_cast<std::uint32_t>(i));
        }
        for (const auto& same_parity : classes)
            parallel_for(
                static_cast<Index>(same_parity.size()),
                [&](Index c) {
                    Cell& cell = cells_[same_parity[c]];
                    for (const std::uint32_t i : cell.waiting)
                        accepted[i] = try_dart(cell, source[begin + i].at, begin + i, refining, features[i]);
                    cell.waiting.clear();
                },
                16);
    }

    /// min(D, R) to the closest dart, in units of R.
    float gap(const SurfacePoint& x) {
        float closest = 1.0f;
        const std::int32_t id = cell_of(x.position);
        for_each_near(cells_[id], x, [&](const Dart&, float d) {
            closest = std::min(closest, d / options_.spacing);
            return true;
        });
        return closest;
    }

    bool narrow(const SurfacePoint& x) const {
        constexpr int rays = 16;
        const float reach = 3.0f * options_.spacing;
        const Frame frame(x.normal);
        float inverse_sum = 0.0f;
        for (int k = 0; k < rays; ++k) {
            const Vec3 direction = frame.to_world(sample_cosine(scrambled_sobol2(k, 13)));
            const Hit hit = surface_.closest_hit({surface_.lifted(x), direction, reach});
            inverse_sum += 1.0f / std::max(hit ? hit.distance : reach, 1e-6f * reach);
        }
        return static_cast<float>(rays) / inverse_sum < options_.spacing / 6.0f;
    }

    std::vector<Dart> darts() const {
        std::vector<Dart> all;
        for (const Cell& cell : cells_) all.insert(all.end(), cell.darts.begin(), cell.darts.end());
        std::sort(all.begin(), all.end(),
                  [](const Dart& a, const Dart& b) { return a.candidate < b.candidate; });
        return all;
    }

private:
    /// Calls visit(dart, D) for the darts with D < R until it returns false.
    template <class Visit>
    void for_each_near(const Cell& cell, const SurfacePoint& x, const Visit& visit) const {
        constexpr std::size_t itself = 13; // most likely to hold a conflict
        for (std::size_t k = 0; k < cell.neighbour.size(); ++k) {
            const std::int32_t id = cell.neighbour[k == 0 ? itself : k <= itself ? k - 1 : k];
            if (id < 0) continue;
            for (const Dart& dart : cells_[id].darts) {
                const Vec3 offset = x.position - dart.at.position;
                const float distance2 = offset.squaredNorm();
                if (distance2 >= options_.spacing * options_.spacing) continue;
                const float cosine = x.normal.dot(dart.at.normal);
                if (cosine <= 0.0f) continue;
                const float h = std::min(std::abs(offset.dot(x.normal)), std::abs(offset.dot(dart.at.normal)));
                const float d = std::sqrt(distance2 + 8.0f * h * h)
                                / cosine_power(cosine, options_.placement_power);
                if (d < options_.spacing && !visit(dart, d)) return;
            }
        }
    }

    /// Whether x, in this cell, conflicts with no dart that is there. Sets the feature where it decides.
    bool fits(const Cell& cell, const SurfacePoint& x, bool refining,
              std::optional<Openness>& feature) const {
        const float s = options_.openness_density;
        bool conflict = false;
        if (!refining) {
            for_each_near(cell, x, [&](const Dart&, float) {
                conflict = true;
                return false;
            });
            return !conflict;
        }
        struct Near {
            const Dart* dart;
            float distance;
        };
        std::array<Near, 128> near;
        int count = 0;
        for_each_near(cell, x, [&](const Dart& dart, float d) {
            conflict = d < options_.spacing / 32.0f || count == static_cast<int>(near.size());
            if (!conflict) near[count++] = {&dart, d};
            return !conflict;
        });
        if (conflict) return false;
        if (!feature) feature = probe_(x);
        return std::none_of(near.begin(), near.begin() + count, [&](const Near& n) {
            const float difference2 = openness_difference2(*feature, n.dart->openness);
            return n.distance * std::exp(difference2 / (2.0f * s * s)) < options_.spacing;
        });
    }

    bool try_dart(Cell& cell, const SurfacePoint& x, std::size_t candidate, bool refining,
                  std::optional<Openness>& feature) const {
        if (!fits(cell, x, refining, feature)) return false;
        if (!refining && options_.skip_narrow && narrow(x)) return false;
        if (!feature) feature = options_.openness_density > 0.0f ? probe_(x) : Openness::Zero();
        cell.darts.push_back({x, candidate, *feature});
        return true;
    }

    CellKey key_of(const Vec3& x) const {
        CellKey key;
        for (int a = 0; a < 3; ++a) key[a] = static_cast<std::int32_t>(std::floor(x[a] / options_.spacing));
        return key;
    }

    std::int32_t cell_of(const Vec3& x) {
        const CellKey key = key_of(x);
        if (const std::int32_t found = index_.find(key); found >= 0) return found;
        const auto id = static_cast<std::int32_t>(cells_.size());
        Cell& cell = cells_.emplace_back();
        cell.parity = (key[0] & 1) | (key[1] & 1) << 1 | (key[2] & 1) << 2;
        index_.insert(key, id);
        for (int k = 0; k < 27; ++k) {
            const std::int32_t near =
                index_.find({key[0] + k % 3 - 1, key[1] + k / 3 % 3 - 1, key[2] + k / 9 - 1});
            cell.neighbour[k] = near;
            if (near >= 0) cells_[near].neighbour[26 - k] = id;
        }
        return id;
    }

    const Surface& surface_;
    const PoissonDiskOptions& options_;
    OpennessProbe probe_;
    std::vector<Cell> cells_;
    CellIndex index_;
};

} // namespace

PoissonDisk poisson_disk(CandidateSource& source, const PoissonDiskOptions& options) {
    DartBoard board(source.surface(), options);
    bool refining = options.openness_density > 0.0f;
    std::size_t next = options.first_candidate, accepted_total = 0;
    int failures = 0;
    std::vector<char> accepted;
    // Rounds stay small against what is there already, so that the order of cells leaves no pattern.
    while (failures < options.failures_to_end) {
        const std::size_t round = std::max<std::size_t>(2048, accepted_total / 2);
        source.ensure(next + round);
        board.throw_darts(source, next, next + round, refining, accepted);
        const auto hits = static_cast<std::size_t>(std::count(accepted.begin(), accepted.end(), 1));
        for (const char a : accepted) failures = a ? 0 : failures + 1;
        accepted_total += hits;
        next += round;
        // Features cost rays, and narrow contacts are met seldom: past this rate another dart changes
        // little, and what remains is to leave no hole of size R.
        if (refining && hits * 48 < round) {
            refining = false;
            failures = 0;
        }
    }

    PoissonDisk disk;
    const std::size_t fresh = 4096;
    source.ensure(next + fresh);
    for (std::size_t i = next; i < next + fresh; ++i) {
        const float gap = board.gap(source[i].at);
        if (gap > disk.largest_gap && !(options.skip_narrow && gap >= 1.0f && board.narrow(source[i].at)))
            disk.largest_gap = gap;
    }
    for (const Dart& dart : board.darts()) {
        disk.points.push_back(source[dart.candidate]);
        if (options.openness_density > 0.0f) disk.openness.push_back(dart.openness);
    }
    disk.candidates_tried = next - options.first_candidate;
    return disk;
}

} // namespace afterglow
