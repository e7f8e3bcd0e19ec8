#include "tests/support/surface_samples.h"

#include "core/sampling.h"
#include "tests/support/quad.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

std::vector<SurfacePoint> points_by_area(const Scene& scene, int count, std::uint64_t seed) {
    const auto corner = [&](std::size_t t, int c) {
        return scene.positions[scene.triangles[t][c]];
    };
    const auto cross = [&](std::size_t t) -> Vec3 {
        return (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
    };
    std::vector<double> area_below;
    double total = 0.0;
    for (std::size_t t = 0; t < scene.triangles.size(); ++t)
        area_below.push_back(total += cross(t).norm());
    std::vector<SurfacePoint> points;
    for (int i = 0; i < count; ++i) {
        Rng rng(seed, static_cast<std::uint64_t>(i));
        const double chosen = total * (i + rng.uniform()) / count;
        const auto t = static_cast<std::size_t>(
            std::upper_bound(area_below.begin(), area_below.end() - 1, chosen)
            - area_below.begin());
        const float s = std::sqrt(rng.uniform()), r = rng.uniform();
        points.push_back({corner(t, 0) + s * (1.0f - r) * (corner(t, 1) - corner(t, 0))
                              + s * r * (corner(t, 2) - corner(t, 0)),
                          cross(t).normalized()});
    }
    return points;
}

std::vector<SurfacePoint> points_in_sight(const Surface& surface, const Vec3& from, int rays,
                                          std::uint64_t seed) {
    std::vector<SurfacePoint> points;
    for (int k = 0; k < rays; ++k) {
        Rng rng(seed, static_cast<std::uint64_t>(k));
        const float u = rng.uniform(), v = rng.uniform();
        const Hit hit = surface.closest_hit({from, sample_sphere({u, v})});
        if (hit) points.push_back(surface.point(hit));
    }
    return points;
}

Scene make_ground(float half_side) {
    Scene scene;
    scene.materials = {{}};
    const float a = half_side;
    add_quad(scene, {Vec3(-a, 0, a), Vec3(a, 0, a), Vec3(a, 0, -a), Vec3(-a, 0, -a)});
    return scene;
}

Scene make_corner(float size) {
    Scene scene;
    scene.materials = {{}};
    const float a = size;
    add_quad(scene, {Vec3(0, 0, a), Vec3(a, 0, a), Vec3(a, 0, -a), Vec3(0, 0, -a)});
    add_quad(scene, {Vec3(0, 0, -a), Vec3(0, a, -a), Vec3(0, a, a), Vec3(0, 0, a)});
    return scene;
}

} // namespace afterglow
