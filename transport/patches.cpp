#include "transport/patches.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

namespace afterglow {
namespace {

/// Centroid and normal of a triangle of no given length; nothing where it has no area.
struct Lie {
    Vec3 centroid, normal;
};
Lie lie_of(const Scene& scene, std::uint32_t triangle) {
    const Triangle& t = scene.triangles[triangle];
    const Vec3 &a = scene.positions[t[0]], &b = scene.positions[t[1]], &c = scene.positions[t[2]];
    return {(a + b + c) / 3.0f, scene.triangle_normal(triangle)};
}

/// Small triangles of one key are alike enough to share a cell.
struct Likeness {
    std::array<std::int32_t, 3> cube, normal;
    std::uint32_t material;
    bool operator==(const Likeness&) const = default;
};
Likeness likeness_of(const Scene& scene, std::uint32_t triangle, const Vec3& origin, float size) {
    constexpr float cube_share = 0.75f, normal_steps = 3.0f;
    const Lie lie = lie_of(scene, triangle);
    Likeness key{{}, {}, scene.material_index[triangle]};
    for (int a = 0; a < 3; ++a) {
        key.cube[a] = static_cast<std::int32_t>(std::floor((lie.centroid[a] - origin[a]) / (cube_share * size)));
        key.normal[a] = static_cast<std::int32_t>(std::lround(normal_steps * lie.normal[a]));
    }
    return key;
}
std::uint64_t hash_of(const Likeness& key) {
    std::uint64_t h = key.material;
    for (int a = 0; a < 3; ++a) {
        h = hash64(h, static_cast<std::uint32_t>(key.cube[a]));
        h = hash64(h, static_cast<std::uint32_t>(key.normal[a]));
    }
    return h;
}

} // namespace

PatchGrid::PatchGrid(const Scene& scene, float size, const Eigen::AlignedBox3f& used)
    : scene_(scene), size_(size), cells_(scene.triangles.size()) {
    constexpr float most_along = 1024.0f, many_along = 16.0f;
    std::uint64_t cells = 0;
    std::vector<std::uint32_t> small;
    for (std::uint32_t t = 0; t < cells_.size(); ++t) {
        const Triangle& corner = scene.triangles[t];
        const Vec3& a = scene.positions[corner[0]];
        const Vec3 ab = scene.positions[corner[1]] - a, ac = scene.positions[corner[2]] - a;
        const float longest2 = std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()});
        if (longest2 <= 0.25f * size * size) {
            small.push_back(t);
            continue;
        }
        const float along_u = std::max(1.0f, std::ceil(ab.norm() / size));
        const float along_v = std::max(1.0f, std::ceil(ac.norm() / size));
        const Eigen::AlignedBox3f box = Eigen::AlignedBox3f(a).extend(a + ab).extend(a + ac);
        if (const float along = std::max(along_u, along_v); along > most_along || (along > many_along && !used.contains(box))) {
            windows_.push_back(used_window(a, ab, ac, used));
            windows_.back().first = static_cast<std::uint32_t>(cells);
            cells_[t] = {static_cast<std::uint32_t>(windows_.size() - 1), 0, 0};
        } else {
            cells_[t] = {static_cast<std::uint32_t>(cells), static_cast<std::uint16_t>(along_u),
                         static_cast<std::uint16_t>(along_v)};
        }
        large_.push_back(t);
        const Window w = window_of(t);
        cells += static_cast<std::uint64_t>(w.count_u) * w.count_v;
        if (cells + scene.triangles.size() > 0x7fffffffu / 2)
            throw Error("the scene needs more than 10^9 surface patches of size "
                        + std::to_string(size) + "; choose a larger --coarse-radius");
    }
    first_shared_ = static_cast<std::uint32_t>(cells);
    share_cells(small);
    count_ = 2 * (first_shared_ + static_cast<std::uint32_t>(shared_.size()));
}

PatchGrid::Window PatchGrid::window_of(std::uint32_t triangle) const {
    const Cells& c = cells_[triangle];
    if (c.along_u == 0) return windows_[c.first];
    return {c.first, c.along_u, c.along_v, 0, 0, c.along_u, c.along_v};
}

PatchGrid::Window PatchGrid::used_window(const Vec3& a, const Vec3& ab, const Vec3& ac,
                                         const Eigen::AlignedBox3f& used) const {
    // The triangle, in its own coordinates, cut by the six sides of the box [Sutherland and Hodgman 1974].
    using Place = Eigen::Vector2d;
    std::vector<Place> inside = {{0, 0}, {1, 0}, {0, 1}}, cut;
    for (int side = 0; side < 6; ++side) {
        const int axis = side / 2;
        const auto depth = [&](const Place& p) {
            const double x = a[axis] + p.x() * ab[axis] + p.y() * ac[axis];
            return side % 2 == 0 ? x - used.min()[axis] : used.max()[axis] - x;
        };
        cut.clear();
        for (std::size_t k = 0; k < inside.size(); ++k) {
            const Place &from = inside[k], &to = inside[(k + 1) % inside.size()];
            const double d0 = depth(from), d1 = depth(to);
            if (d0 >= 0.0) cut.push_back(from);
            if ((d0 < 0.0) != (d1 < 0.0)) cut.push_back(from + d0 / (d0 - d1) * (to - from));
        }
        inside.swap(cut);
    }
    constexpr double most_along = 1 << 30;
    const auto along = [&](const Vec3& edge) {
        return static_cast<std::uint32_t>(std::clamp(std::ceil(edge.cast<double>().norm() / size_), 1.0, most_along));
    };
    Window w{0, along(ab), along(ac), 0, 0, 1, 1};
    if (inside.empty()) return w;
    const auto limit = [&](int axis, std::uint32_t cells, std::uint32_t& begin, std::uint32_t& count) {
        double least = 1.0, most = 0.0;
        for (const Place& p : inside) {
            least = std::min(least, p[axis]);
            most = std::max(most, p[axis]);
        }
        begin = static_cast<std::uint32_t>(std::clamp(std::floor(least * cells), 0.0, cells - 1.0));
        const auto end = static_cast<std::uint32_t>(std::clamp(std::ceil(most * cells), begin + 1.0, cells * 1.0));
        count = end - begin;
    };
    limit(0, w.along_u, w.begin_u, w.count_u);
    limit(1, w.along_v, w.begin_v, w.count_v);
    return w;
}

std::uint32_t PatchGrid::patch_in(const Window& w, const Hit& hit) {
    const auto cell = [](float place, std::uint32_t along, std::uint32_t begin, std::uint32_t count) {
        const auto k = static_cast<std::uint32_t>(static_cast<double>(place) * along);
        return std::clamp(k, begin, begin + count - 1) - begin;
    };
    const std::uint32_t i = cell(hit.u, w.along_u, w.begin_u, w.count_u);
    const std::uint32_t j = cell(hit.v, w.along_v, w.begin_v, w.count_v);
    return 2 * (w.first + j * w.count_u + i) + static_cast<std::uint32_t>(hit.back_side);
}

void PatchGrid::share_cells(const std::vector<std::uint32_t>& small) {
    // By the upper half of their keys' hashes, then in their own order.
    const Vec3 origin = scene_.bounds().min();
    std::vector<std::uint64_t> order(small.size());
    parallel_for(static_cast<Index>(small.size()), [&](Index k) {
        const std::uint64_t hash = hash_of(likeness_of(scene_, small[static_cast<std::size_t>(k)], origin, size_));
        order[static_cast<std::size_t>(k)] = (hash & 0xffffffff00000000u) | small[static_cast<std::size_t>(k)];
    }, 4096);
    parallel_sort(order);
    std::vector<std::uint32_t> members, first_member;
    const auto finish = [&] {
        if (members.empty()) return;
        const auto cell = static_cast<std::uint32_t>(shared_.size());
        double area = 0.0;
        Eigen::Vector3d middle = Eigen::Vector3d::Zero();
        for (const std::uint32_t t : members) {
            cells_[t] = {cell, 1, 1};
            area += area_of(t);
            middle += area_of(t) * lie_of(scene_, t).centroid.cast<double>();
        }
        middle /= std::max(area, 1e-300);
        const auto distance2 = [&](std::uint32_t t) {
            return (lie_of(scene_, t).centroid.cast<double>() - middle).squaredNorm();
        };
        const auto nearest = std::min_element(members.begin(), members.end(), [&](std::uint32_t a, std::uint32_t b) {
            return distance2(a) < distance2(b);
        });
        shared_.push_back({*nearest, static_cast<float>(area)});
        first_member.push_back(members.front());
        members.clear();
    };
    Likeness last{};
    for (const std::uint64_t key : order) {
        const auto t = static_cast<std::uint32_t>(key);
        const Likeness likeness = likeness_of(scene_, t, origin, size_);
        if (likeness != last) finish(); // two keys of one hash may take turns: more cells, none wrong
        last = likeness;
        members.push_back(t);
    }
    finish();

    // Numbered as the mesh is, so that what is close in it is close in memory.
    std::vector<std::uint64_t> by_member(shared_.size());
    for (std::size_t k = 0; k < shared_.size(); ++k)
        by_member[k] = static_cast<std::uint64_t>(first_member[k]) << 32 | k;
    parallel_sort(by_member);
    std::vector<std::uint32_t> number(shared_.size());
    std::vector<Shared> sorted(shared_.size());
    for (std::size_t k = 0; k < sorted.size(); ++k) {
        const auto old = static_cast<std::uint32_t>(by_member[k]);
        number[old] = first_shared_ + static_cast<std::uint32_t>(k);
        sorted[k] = shared_[old];
    }
    shared_ = std::move(sorted);
    for (const std::uint32_t t : small) cells_[t].first = number[cells_[t].first];
}

PatchGrid::Location PatchGrid::locate(std::uint32_t patch) const {
    const std::uint32_t cell = patch / 2;
    if (cell >= first_shared_) return {shared_[cell - first_shared_].middle, 0, 0};
    const auto next = std::upper_bound(large_.begin(), large_.end(), cell, [&](std::uint32_t c, std::uint32_t t) {
        return c < window_of(t).first;
    });
    const Window w = window_of(*(next - 1));
    return {*(next - 1), w.begin_u + (cell - w.first) % w.count_u, w.begin_v + (cell - w.first) / w.count_u};
}

PatchGrid::Part PatchGrid::part(const Location& at) const {
    // [u0, u1] x [v0, v1] below u + v = 1, where the triangle's third edge runs: the corner
    // triangle that begins at (u0, v0), less those at (u1, v0) and (u0, v1), plus the one taken
    // away twice.
    const Window c = window_of(at.triangle);
    Part part;
    const double du = 1.0 / c.along_u, dv = 1.0 / c.along_v;
    const double u0 = at.i * du, v0 = at.j * dv;
    if (cells_[at.triangle].along_u == 0 && u0 + v0 + du + dv <= 1.0) // too small for the differences below
        return {2.0 * du * dv, u0 + 0.5 * du, v0 + 0.5 * dv};
    for (int k = 0; k < 4; ++k) {
        const double u = static_cast<double>(at.i + (k & 1)) / c.along_u;
        const double v = static_cast<double>(at.j + (k >> 1)) / c.along_v;
        const double side = std::max(0.0, 1.0 - u - v);
        const double share = (k == 0 || k == 3 ? 1.0 : -1.0) * side * side;
        part.share += share;
        part.u += share * (u + side / 3.0);
        part.v += share * (v + side / 3.0);
    }
    if (part.share > 0.0) {
        part.u /= part.share;
        part.v /= part.share;
    }
    return part;
}

Hit PatchGrid::center(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Part part = this->part(at);
    Hit hit;
    hit.distance = 0.0f;
    hit.primitive = at.triangle;
    hit.u = std::clamp(static_cast<float>(part.u), 0.0f, 1.0f);
    hit.v = std::clamp(static_cast<float>(part.v), 0.0f, 1.0f - hit.u);
    hit.back_side = patch & 1u;
    return hit;
}

std::array<Hit, 4> PatchGrid::corners(std::uint32_t patch) const {
    const Location at = locate(patch);
    const Window c = window_of(at.triangle);
    const Hit centre = center(patch);
    std::array<Hit, 4> corners;
    for (std::uint32_t k = 0; k < 4; ++k) {
        float u = static_cast<float>(at.i + (k & 1)) / static_cast<float>(c.along_u);
        float v = static_cast<float>(at.j + (k >> 1)) / static_cast<float>(c.along_v);
        const float beyond = std::max(1.0f, u + v); // the third edge
        u /= beyond;
        v /= beyond;
        corners[k] = centre;
        corners[k].u += 0.98f * (u - centre.u);
        corners[k].v += 0.98f * (v - centre.v);
    }
    return corners;
}

float PatchGrid::area_of(std::uint32_t triangle) const {
    const Triangle& corner = scene_.triangles[triangle];
    const auto position = [&](int c) -> Eigen::Vector3d { return scene_.positions[corner[c]].cast<double>(); };
    const Eigen::Vector3d a = position(0); // fourth powers of lengths need not fit a float
    return static_cast<float>(0.5 * (position(1) - a).cross(position(2) - a).norm());
}

float PatchGrid::area(std::uint32_t patch) const {
    if (patch / 2 >= first_shared_) return shared_[patch / 2 - first_shared_].area;
    const Location at = locate(patch);
    return area_of(at.triangle) * static_cast<float>(std::max(0.0, part(at).share));
}

} // namespace afterglow
