#include "basis/poisson_disk.h"

#include "basis/morton.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

namespace afterglow {
namespace {

constexpr std::uint32_t settled_after = 24; // candidates in a row, whose rays found nothing to refine

struct DartOpenness {
    Openness first_half, whole; // of OpennessProbe
};

struct Cell {
    std::array<std::int32_t, 27> neighbour; // itself included; -1 where nothing is
    int parity;                             // cells of equal parity never touch
    std::vector<SurfacePoint> darts;        // apart from what is seldom asked of them:
    std::vector<DartOpenness> openness;     // one a dart
    std::vector<std::size_t> candidate;     // likewise
    std::vector<std::uint32_t> waiting;     // candidates of this round, by place in the round
    std::uint32_t in_vain = 0;              // candidates since the last dart whose feature was asked for

    /// Whether openness adds no more darts closer than R here.
    bool is_settled() const { return in_vain >= settled_after; }
};

/// The cells around a cell, those first that are closest to the points of one eighth of it: there a
/// conflict is most likely found.
using CellOrder = std::array<std::int8_t, 27>;
std::array<CellOrder, 8> closest_first() {
    std::array<CellOrder, 8> orders;
    for (int eighth = 0; eighth < 8; ++eighth) {
        const auto distance2 = [&](int k) {
            const Vec3 towards(eighth & 1 ? 0.25f : -0.25f, eighth & 2 ? 0.25f : -0.25f,
                               eighth & 4 ? 0.25f : -0.25f);
            return (Vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1).cast<float>() - towards).squaredNorm();
        };
        std::iota(orders[eighth].begin(), orders[eighth].end(), std::int8_t{0});
        std::stable_sort(orders[eighth].begin(), orders[eighth].end(),
                         [&](int a, int b) { return distance2(a) < distance2(b); });
    }
    return orders;
}

using CellKey = std::array<std::int32_t, 3>;

/// From the place of a cell to its number: open addressing, one cache line a look.
class CellIndex {
public:
    /// -1 where there is none.
    std::int32_t find(const CellKey& key) const {
        for (std::size_t k = hash(key);; ++k) {
            const Slot& slot = slots_[k & (slots_.size() - 1)];
            if (slot.id < 0
                || (slot.key[0] == key[0] && slot.key[1] == key[1] && slot.key[2] == key[2]))
                return slot.id;
        }
    }
    void prefetch(const CellKey& key) const { __builtin_prefetch(&slots_[hash(key) & (slots_.size() - 1)]); }
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

    /// Throws candidates that are numbered from `first` on; accepted[i] tells of round[i].
    /// `refining`: the openness feature may add points closer than R.
    void throw_darts(std::span<const Candidate> round, std::size_t first, bool refining,
                     std::vector<char>& accepted) {
        const std::size_t count = round.size();
        accepted.assign(count, 0);
        std::vector<Feature> features(refining ? count : 0);
        const auto feature_of = [&](std::size_t i, const Cell& cell) {
            return refining && !cell.is_settled() ? &features[i] : nullptr;
        };
        // Most conflict with darts of earlier rounds already, in whatever order they are looked at: one
        // beside the other, so that what is around is in the cache.
        std::vector<char> fits_so_far(count);
        std::vector<std::uint64_t> order(count);
        parallel_for(
            static_cast<Index>(count),
            [&](Index i) {
                const CellKey key = key_of(round[i].at.position);
                order[i] = morton_code(key[0] & 1023, key[1] & 1023, key[2] & 1023) << 32
                           | static_cast<std::uint64_t>(i);
            },
            1024);
        parallel_sort(order);
        constexpr Index at_once = 64; // what they need of memory is asked for before it is used
        parallel_ranges(static_cast<Index>(count), at_once, [&](Index begin, Index end) {
            const auto candidate = [&](Index k) { return order[k] & 0xffffffff; };
            std::array<CellKey, at_once> key;
            std::array<std::int32_t, at_once> cell;
            for (Index k = begin; k < end; ++k) __builtin_prefetch(&round[candidate(k)].at);
            for (Index k = begin; k < end; ++k) {
                key[k - begin] = key_of(round[candidate(k)].at.position);
                index_.prefetch(key[k - begin]);
            }
            for (Index k = begin; k < end; ++k) {
                cell[k - begin] = index_.find(key[k - begin]);
                if (cell[k - begin] >= 0) __builtin_prefetch(&cells_[cell[k - begin]]);
            }
            for (Index k = begin; k < end; ++k) {
                const std::size_t i = candidate(k);
                const std::int32_t id = cell[k - begin];
                fits_so_far[i] = id < 0 || fits(cells_[id], round[i].at, feature_of(i, cells_[id]));
            }
        });
        std::array<std::vector<std::int32_t>, 8> classes;
        for (std::size_t i = 0; i < count; ++i) {
            if (!fits_so_far[i]) continue;
            const std::int32_t id = cell_of(round[i].at.position);
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
                        accepted[i] = try_dart(cell, round[i].at, first + i, feature_of(i, cell));
                    cell.waiting.clear();
                },
                16);
        for (std::size_t i = 0; i < features.size(); ++i)
            if (features[i].first_half) {
                Cell& cell = cells_[cell_of(round[i].at.position)];
                cell.in_vain = accepted[i] ? 0 : cell.in_vain + 1;
            }
    }

    /// Candidates for the holes around a dart at x: places along its tangent plane a little more than R away.
    /// Whatever hole there is lies beside such places of all darts around it.
    void find_holes(const SurfacePoint& x, std::uint64_t seed, std::vector<Candidate>& holes) const {
        constexpr int directions = 8;
        const float spacing = options_.spacing;
        const Frame frame(x.normal);
        const float turn = Rng(seed, 0x41b).uniform();
        for (int k = 0; k < directions; ++k) {
            const float angle = 2.0f * static_cast<float>(M_PI) * (static_cast<float>(k) + turn) / directions;
            const Vec3 ahead = spacing * frame.to_world(Vec3(std::cos(angle), std::sin(angle), 0.0f));
            const Vec3 aside = ahead.cross(x.normal);
            const Vec3 guess = x.position + 1.2f * ahead;
            const auto covered = [&](const Vec3& place) {
                const std::int32_t id = index_.find(key_of(place));
                return id >= 0 && !fits(cells_[id], {place, x.normal}, nullptr);
            };
            if (covered(guess)) continue;
            const Vec3 above = guess + 0.2f * spacing * x.normal;
            if (surface_.blocked(surface_.lifted(x), above)) continue;
            const Hit hit = surface_.closest_hit({above, -x.normal, 0.4f * spacing});
            if (!hit) continue;
            const SurfacePoint y = surface_.point(hit);
            const bool enclosed
                = covered(guess + ahead) + covered(guess + aside) + covered(guess - aside) >= 2;
            if (enclosed || faces_the_void(y)) holes.push_back({y, hit});
        }
    }

    /// Of all darts, in the order of their numbers.
    std::vector<Openness> openness() const {
        std::vector<std::pair<std::size_t, const Openness*>> all;
        for (const Cell& cell : cells_)
            for (std::size_t k = 0; k < cell.darts.size(); ++k)
                all.emplace_back(cell.candidate[k], &cell.openness[k].whole);
        std::sort(all.begin(), all.end());
        std::vector<Openness> ordered;
        for (const auto& [number, openness] : all) ordered.push_back(*openness);
        return ordered;
    }

private:
    struct Near {
        const DartOpenness* openness;
        float distance;
    };
    /// A candidate's openness, as far as it was asked for.
    struct Feature {
        std::optional<Openness> first_half, whole;
    };

    /// Calls visit(cell, number in it, D) for the darts with D < R until it returns false.
    template <class Visit>
    void for_each_near(const Cell& cell, const SurfacePoint& x, const Visit& visit) const {
        const float spacing2 = options_.spacing * options_.spacing;
        const Vec3 in_cells = x.position / options_.spacing;
        const Vec3 inside = in_cells - in_cells.array().floor().matrix();
        const int eighth = (inside.x() >= 0.5f) | (inside.y() >= 0.5f) << 1 | (inside.z() >= 0.5f) << 2;
        // Squared distances to the cells before, at and after one's own along each axis, in units of R.
        std::array<std::array<float, 3>, 3> to_cell;
        for (int a = 0; a < 3; ++a)
            to_cell[a] = {inside[a] * inside[a], 0.0f, (1.0f - inside[a]) * (1.0f - inside[a])};
        for (const int k : closest_first_[eighth]) {
            const std::int32_t id = cell.neighbour[k];
            if (id < 0) continue;
            constexpr float out_of_reach = 1.01f; // of R^2; the rest is rounding
            if (to_cell[0][k % 3] + to_cell[1][k / 3 % 3] + to_cell[2][k / 9] > out_of_reach) continue;
            const Cell& other = cells_[id];
            for (std::size_t j = 0; j < other.darts.size(); ++j) {
                const SurfacePoint& dart = other.darts[j];
                const Vec3 offset = x.position - dart.position;
                const float distance2 = offset.squaredNorm();
                if (distance2 >= spacing2) continue;
                const float cosine = x.normal.dot(dart.normal);
                if (cosine <= 0.0f) continue;
                const float h = std::min(std::abs(offset.dot(x.normal)), std::abs(offset.dot(dart.normal)));
                const float d = std::sqrt(distance2 + 8.0f * h * h)
                                / cosine_power(cosine, options_.placement_power);
                if (d < options_.spacing && !visit(other, j, d)) return;
            }
        }
    }

    /// Sixteen directions over x, of equal shares of a lambertian's light.
    static std::array<Vec3, 16> directions_over(const SurfacePoint& x) {
        const Frame frame(x.normal);
        std::array<Vec3, 16> directions;
        for (std::size_t k = 0; k < directions.size(); ++k)
            directions[k] = frame.to_world(sample_cosine(scrambled_sobol2(static_cast<std::uint32_t>(k), 13)));
        return directions;
    }

    /// Whether a quarter of what is seen from x is empty. No particle comes from there, though one may look
    /// from there.
    bool faces_the_void(const SurfacePoint& x) const {
        const auto directions = directions_over(x);
        const auto escaped = std::ranges::count_if(directions, [&](const Vec3& direction) {
            return !surface_.occluded({surface_.lifted(x), direction});
        });
        return 4 * escaped >= std::ssize(directions);
    }

    bool narrow(const SurfacePoint& x) const {
        const float reach = 3.0f * options_.spacing;
        const auto directions = directions_over(x);
        float inverse_sum = 0.0f;
        for (const Vec3& direction : directions) {
            const Hit hit = surface_.closest_hit({surface_.lifted(x), direction, reach});
            inverse_sum += 1.0f / std::max(hit ? hit.distance : reach, 1e-6f * reach);
        }
        return static_cast<float>(directions.size()) / inverse_sum < options_.spacing / 6.0f;
    }

    /// Whether x, in this cell, conflicts with no dart that is there. `feature`: null unless refining; is
    /// set where it decides.
    bool fits(const Cell& cell, const SurfacePoint& x, Feature* feature) const {
        bool conflict = false;
        if (!feature) {
            for_each_near(cell, x, [&](const Cell&, std::size_t, float) {
                conflict = true;
                return false;
            });
            return !conflict;
        }
        std::array<Near, 128> near;
        std::size_t count = 0, closest = 0;
        for_each_near(cell, x, [&](const Cell& other, std::size_t j, float d) {
            conflict = d < options_.spacing / 32.0f || count == near.size();
            if (conflict) return false;
            near[count] = {&other.openness[j], d};
            if (d < near[closest].distance) closest = count;
            ++count;
            return true;
        });
        if (conflict) return false;
        if (count > 0) std::swap(near[0], near[closest]);
        const std::span<const Near> found(near.data(), count);
        // What differs by less than half of what is asked for with half of the rays is not looked at with all.
        if (!feature->first_half) feature->first_half = probe_.first_half(x);
        for (const Near& n : found)
            if (4.0f * openness_difference2(*feature->first_half, n.openness->first_half)
                < most_difference2(n.distance))
                return false;
        if (!feature->whole) feature->whole = probe_.completed(x, *feature->first_half);
        return std::none_of(found.begin(), found.end(), [&](const Near& n) {
            return openness_difference2(*feature->whole, n.openness->whole) < most_difference2(n.distance);
        });
    }

    /// A dart at this D < R is in conflict with what differs from it by less: D exp(|dF|^2 / (2 s^2)) < R.
    float most_difference2(float distance) const {
        const float s = options_.openness_density;
        return 2.0f * s * s * std::log(options_.spacing / distance);
    }

    bool try_dart(Cell& cell, const SurfacePoint& x, std::size_t candidate, Feature* feature) const {
        if (!fits(cell, x, feature)) return false;
        if (!feature && options_.skip_narrow && narrow(x)) return false;
        DartOpenness openness{Openness::Zero(), Openness::Zero()};
        if (feature) {
            openness = {*feature->first_half, *feature->whole};
        } else if (options_.openness_density > 0.0f) {
            openness.first_half = probe_.first_half(x);
            openness.whole = probe_.completed(x, openness.first_half);
        }
        cell.darts.push_back(x);
        cell.openness.push_back(openness);
        cell.candidate.push_back(candidate);
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
    const std::array<CellOrder, 8> closest_first_ = closest_first();
};

} // namespace

PoissonDisk poisson_disk(CandidateSource& source, const PoissonDiskOptions& options) {
    if (!(options.spacing > 8.0f * source.surface().lift())) // nor would cells fit their numbers
        throw UsageError("functions that close to each other cannot be told apart in this scene; "
                         "give a wider --coarse-radius or fewer levels");
    DartBoard board(source.surface(), options);
    const bool by_openness = options.openness_density > 0.0f;
    PoissonDisk disk;
    std::size_t thrown = 0;
    std::vector<char> accepted;
    const auto throw_darts = [&](std::span<const Candidate> round, bool refining) {
        board.throw_darts(round, thrown, refining, accepted);
        thrown += round.size();
        const std::size_t before = disk.points.size();
        for (std::size_t i = 0; i < round.size(); ++i)
            if (accepted[i]) disk.points.push_back(round[i]);
        return disk.points.size() - before; // how many fitted
    };
    // Rounds stay small against what is there already, so that the order of cells leaves no pattern.
    const auto throw_candidates = [&](int per_point, bool refining) {
        std::vector<Candidate> round;
        for (bool done = false; !done;) {
            round.resize(std::max<std::size_t>(2048, disk.points.size() / 2));
            source.ensure(disk.candidates_tried + round.size());
            parallel_for(
                static_cast<Index>(round.size()),
                [&](Index i) { round[i] = source[disk.candidates_tried + i]; }, 1024);
            const std::size_t fitted = throw_darts(round, refining);
            done = static_cast<std::size_t>(per_point) * fitted < round.size();
            disk.candidates_tried += round.size();
        }
    };
    throw_candidates(options.candidates_per_point, by_openness);
    if (!by_openness) return disk;

    // What fills a hole may leave smaller ones.
    constexpr int fills = 3;
    std::size_t looked_around = 0;
    for (int fill = 0; fill < fills; ++fill) {
        std::vector<std::vector<Candidate>> holes(disk.points.size() - looked_around);
        parallel_for(
            static_cast<Index>(holes.size()),
            [&](Index i) {
                const std::size_t k = looked_around + i;
                board.find_holes(disk.points[k].at, k, holes[i]);
            },
            64);
        looked_around = disk.points.size();
        std::vector<Candidate> round;
        for (const auto& around : holes) round.insert(round.end(), around.begin(), around.end());
        throw_darts(round, false);
    }
    // What is left are strips too narrow to be found like that, for many darts; but these cast no rays.
    throw_candidates(options.candidates_per_last_point, false);
    disk.openness = board.openness();
    return disk;
}

} // namespace afterglow
