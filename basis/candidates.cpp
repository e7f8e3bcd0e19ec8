#include "basis/candidates.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

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

constexpr int looking_paths = 128; // of reachable_places()

/// Points in the open on the segments of diffuse paths from `from`; `long_paths`: how many of the paths leave
/// a candidate.
std::vector<Vec3> reachable_places(const Surface& surface, const Vec3& from, std::uint64_t seed,
                                   int* long_paths = nullptr) {
    std::vector<Vec3> places;
    for (int path = 0; path < looking_paths; ++path) {
        Rng rng(seed, path);
        Vec3 origin = from;
        Vec3 direction = sample_sphere({rng.uniform(), rng.uniform()});
        for (int bounce = 0; bounce < 16; ++bounce) {
            const Hit hit = surface.closest_hit({origin, direction});
            if (!hit) break;
            if (long_paths && bounce == skipped_bounces) ++*long_paths;
            places.push_back(origin + rng.uniform() * hit.distance * direction);
            const SurfacePoint x = surface.point(hit);
            origin = surface.lifted(x);
            direction = Frame(x.normal).to_world(sample_cosine({rng.uniform(), rng.uniform()}));
        }
    }
    return places;
}

struct Lookout {
    Vec3 place;
    Outlook outlook;
};

/// By falling score.
std::vector<Lookout> looked_from(const Surface& surface, const std::vector<Vec3>& places) {
    std::vector<Lookout> lookouts(places.size());
    parallel_for(static_cast<Index>(places.size()),
                 [&](Index i) { lookouts[i] = {places[i], look_around(surface, places[i])}; });
    // A scene may be wound the other way as a whole: then most of what one sees from open places, not
    // from inside solids, are back sides.
    double fronts = 0.0, backs = 0.0;
    for (const Lookout& l : lookouts) {
        fronts += l.outlook.front_share * l.outlook.openness();
        backs += (1.0 - l.outlook.front_share) * l.outlook.openness();
    }
    if (backs > 2.0 * fronts)
        for (Lookout& l : lookouts) l.outlook.front_share = 1.0 - l.outlook.front_share;
    std::stable_sort(lookouts.begin(), lookouts.end(),
                     [](const Lookout& a, const Lookout& b) { return a.outlook.score() > b.outlook.score(); });
    return lookouts;
}

/// Anywhere in the scene's bounding box.
std::vector<Vec3> places_in_box(const Surface& surface, int count, std::uint64_t seed) {
    const Eigen::AlignedBox3f box = surface.scene().bounds();
    std::vector<Vec3> places;
    for (int i = 0; i < count; ++i) {
        Rng rng(seed, static_cast<std::uint64_t>(i));
        const float z = rng.uniform(), y = rng.uniform(), x = rng.uniform(); // in this order by any compiler
        const Vec3 u(x, y, z);
        places.push_back(box.min() + box.sizes().cwiseProduct(u));
    }
    return places;
}

/// In the open between two surfaces, of which one is a triangle that is any with equal chance: where the
/// triangles are, however far the ground reaches around them.
std::vector<Vec3> places_off_triangles(const Surface& surface, int count, std::uint64_t seed) {
    std::vector<Vec3> places;
    const auto triangles = static_cast<double>(surface.scene().triangles.size());
    for (int i = 0; i < count && triangles > 0.0; ++i) {
        Rng rng(seed, static_cast<std::uint64_t>(i));
        Hit from;
        from.primitive = static_cast<std::uint32_t>(rng.uniform() * triangles);
        from.back_side = rng.uniform() < 0.5f;
        from.u = 1.0f - std::sqrt(rng.uniform());
        from.v = (1.0f - from.u) * rng.uniform();
        const SurfacePoint x = surface.point(from);
        const Vec3 origin = surface.lifted(x);
        const Vec3 direction = Frame(x.normal).to_world(sample_cosine({rng.uniform(), rng.uniform()}));
        if (const Hit hit = surface.closest_hit({origin, direction}))
            places.push_back(origin + rng.uniform() * hit.distance * direction);
    }
    return places;
}

/// The first from which enough particles live to leave candidates; none where there is none.
const Lookout* first_that_holds_light(const Surface& surface, std::span<const Lookout> lookouts, std::uint64_t seed) {
    for (const Lookout& l : lookouts) {
        if (l.outlook.score() <= 0.0) break;
        int long_paths = 0;
        reachable_places(surface, l.place, seed, &long_paths);
        if (long_paths >= looking_paths / 16) return &l;
    }
    return nullptr;
}

} // namespace

std::vector<Vec3> find_viewpoints(const Surface& surface, std::uint64_t seed) {
    constexpr int tried = 512;
    std::vector<Lookout> lookouts = looked_from(surface, places_in_box(surface, tried, seed));
    const Lookout* first = first_that_holds_light(surface, lookouts, hash64(seed, 1));
    if (!first) {
        std::vector<Lookout> others = looked_from(surface, places_off_triangles(surface, tried, hash64(seed, 2)));
        if (const Lookout* found = first_that_holds_light(surface, others, hash64(seed, 1))) {
            lookouts.swap(others); // pointers stay
            first = found;
        }
    }
    if (!first && lookouts.front().outlook.score() <= 0.0) return {surface.scene().bounds().center()};
    if (!first) first = &lookouts.front();

    std::vector<Vec3> viewpoints{first->place};
    std::vector<Vec3> known = reachable_places(surface, viewpoints[0], hash64(seed, 1));
    for (const Lookout& l : lookouts) {
        const Outlook& o = l.outlook;
        if (o.score() < 0.1 * first->outlook.score() || o.hit_share < 0.9 || o.front_share < 0.9) continue;
        const bool seen = std::any_of(known.begin(), known.end(),
                                      [&](const Vec3& p) { return !surface.blocked(l.place, p); });
        if (seen) continue;
        viewpoints.push_back(l.place);
        const auto more = reachable_places(surface, l.place, hash64(seed, viewpoints.size()));
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
        fruitless = places_.size() == before ? fruitless + 1 : 0;
        if (fruitless > 8)
            throw Error("no surface is reached from the viewpoint; name another with --viewpoint");
    }
}

double CandidateSource::mean_ray_length() const {
    return length_count_ > 0 ? length_sum_ / static_cast<double>(length_count_) : 0.0;
}

} // namespace afterglow
