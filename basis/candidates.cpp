#include "basis/candidates.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace afterglow {
namespace {

constexpr int most_bounces = 30, skipped_bounces = 3;

struct Outlook {
    double hit_share = 0.0, front_share = 0.0, mean_distance = 0.0;
    /// Large where one looks far and little escapes.
    double openness() const { return hit_share * mean_distance; }
    /// Large where one looks at front sides too; single sheets may be wound the other way.
    double score() const { return (0.1 + front_share) * openness(); }
};

Outlook look_around(const Surface& surface, const Vec3& from) {
    constexpr int rays = 64;
    int hits = 0, fronts = 0;
    double distance = 0.0;
    for (int k = 0; k < rays; ++k) {
        const Hit hit = surface.closest_hit({from, sample_sphere(scrambled_sobol2(k, 7))});
        if (!hit) continue;
        ++hits;
        fronts += !hit.back_side;
        distance += hit.distance;
    }
    if (hits == 0) return {};
    return {static_cast<double>(hits) / rays, static_cast<double>(fronts) / hits, distance / hits};
}

/// Points in the open on the segments of diffuse paths from `from`.
std::vector<Vec3> reachable_places(const Surface& surface, const Vec3& from, std::uint64_t seed) {
    std::vector<Vec3> places;
    for (int path = 0; path < 128; ++path) {
        Rng rng(seed, path);
        Vec3 origin = from;
        Vec3 direction = sample_sphere({rng.uniform(), rng.uniform()});
        for (int bounce = 0; bounce < 16; ++bounce) {
            const Hit hit = surface.closest_hit({origin, direction});
            if (!hit) break;
            places.push_back(origin + rng.uniform() * hit.distance * direction);
            const SurfacePoint x = surface.point(hit);
            origin = surface.lifted(x);
            direction = Frame(x.normal).to_world(sample_cosine({rng.uniform(), rng.uniform()}));
        }
    }
    return places;
}

} // namespace

std::vector<Vec3> find_viewpoints(const Surface& surface, std::uint64_t seed) {
    constexpr int tried = 512;
    const Eigen::AlignedBox3f box = surface.scene().bounds();
    std::vector<Vec3> place(tried);
    std::vector<Outlook> outlook(tried);
    parallel_for(tried, [&](Index i) {
        Rng rng(seed, static_cast<std::uint64_t>(i));
        const Vec3 u(rng.uniform(), rng.uniform(), rng.uniform());
        place[i] = box.min() + box.sizes().cwiseProduct(u);
        outlook[i] = look_around(surface, place[i]);
    });
    // A scene may be wound the other way as a whole: then most of what one sees from open places, not
    // from inside solids, are back sides.
    double fronts = 0.0, backs = 0.0;
    for (const Outlook& o : outlook) {
        fronts += o.front_share * o.openness();
        backs += (1.0 - o.front_share) * o.openness();
    }
    if (backs > 2.0 * fronts)
        for (Outlook& o : outlook) o.front_share = 1.0 - o.front_share;

    std::vector<int> order(tried);
    for (int i = 0; i < tried; ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return outlook[a].score() > outlook[b].score(); });
    if (outlook[order[0]].score() <= 0.0) return {box.center()};

    const double best = outlook[order[0]].score();
    std::vector<Vec3> viewpoints{place[order[0]]};
    std::vector<Vec3> known = reachable_places(surface, viewpoints[0], hash64(seed, 1));
    for (int i : order) {
        const Outlook& o = outlook[i];
        if (o.score() < 0.1 * best || o.hit_share < 0.9 || o.front_share < 0.9) continue;
        const bool seen = std::any_of(known.begin(), known.end(), [&](const Vec3& p) {
            return !surface.blocked(place[i], p);
        });
        if (seen) continue;
        viewpoints.push_back(place[i]);
        const auto more = reachable_places(surface, place[i], hash64(seed, viewpoints.size()));
        known.insert(known.end(), more.begin(), more.end());
    }
    return viewpoints;
}

CandidateSource::CandidateSource(const Surface& surface, std::vector<Vec3> viewpoints,
                                 std::uint64_t seed)
    : surface_(surface), viewpoints_(std::move(viewpoints)), seed_(hash64(seed, 0x9a7c1e5)) {
    if (surface.scene().triangles.size() >> 31) throw Error("the scene has more triangles than 2^31 - 1");
    ensure(1);
}

Candidate CandidateSource::operator[](std::size_t i) const {
    const Place& place = places_[i];
    Hit hit;
    hit.primitive = place.primitive;
    hit.back_side = place.back_side;
    hit.u = place.u, hit.v = place.v;
    return {surface_.point(hit), hit};
}

void CandidateSource::ensure(std::size_t count) {
    constexpr Index paths_at_once = 4096;
    struct Path {
        std::array<Place, most_bounces - skipped_bounces> left;
        double length_sum = 0.0;
        std::uint32_t rays = 0, hits = 0; // those that leave a place
    };
    std::vector<Path> paths(paths_at_once);
    for (int fruitless = 0; places_.size() < count;) {
        parallel_for(
            paths_at_once,
            [&](Index i) {
                Path& path = paths[i];
                path.length_sum = 0.0;
                path.rays = path.hits = 0;
                const std::uint64_t id = next_path_ + static_cast<std::uint64_t>(i);
                Rng rng(seed_, id);
                Vec3 origin = viewpoints_[id % viewpoints_.size()];
                Vec3 direction = sample_sphere({rng.uniform(), rng.uniform()});
                for (int bounce = 0; bounce < most_bounces; ++bounce) {
                    const Hit hit = surface_.closest_hit({origin, direction});
                    ++path.rays;
                    if (!hit) break;
                    const SurfacePoint x = surface_.point(hit);
                    if (bounce >= skipped_bounces) {
                        path.left[path.hits++] = {hit.primitive, hit.back_side, hit.u, hit.v};
                        path.length_sum += hit.distance;
                    }
                    origin = surface_.lifted(x);
                    direction = Frame(x.normal).to_world(sample_cosine({rng.uniform(), rng.uniform()}));
                }
            },
            32);
        next_path_ += paths_at_once;
        const std::size_t before = places_.size();
        for (const Path& path : paths) {
            places_.insert(places_.end(), path.left.begin(), path.left.begin() + path.hits);
            length_sum_ += path.length_sum;
            length_count_ += path.hits;
            rays_ += path.rays;
        }
        if (places_.size() == before && ++fruitless > 8)
            throw Error("no surface is reached from the viewpoint; name another with --viewpoint");
    }
}

double CandidateSource::mean_ray_length() const {
    return length_count_ > 0 ? length_sum_ / static_cast<double>(length_count_) : 0.0;
}

} // namespace afterglow
