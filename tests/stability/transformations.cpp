#include "tests/stability/transformations.h"

#include "core/sampling.h"

#include <Eigen/Geometry>

#include <cassert>
#include <utility>

namespace afterglow {
namespace {

/// The materials of a scene, and triangles to come.
class Remeshed {
public:
    explicit Remeshed(const Scene& from) : from_(from) {
        scene_.name = from.name;
        scene_.materials = from.materials;
        scene_.viewpoint = from.viewpoint;
    }
    /// A triangle with the material of triangle t of the old scene.
    void add(const Vec3& a, const Vec3& b, const Vec3& c, std::size_t t) {
        const auto first = static_cast<std::uint32_t>(scene_.positions.size());
        scene_.positions.insert(scene_.positions.end(), {a, b, c});
        scene_.triangles.push_back({first, first + 1, first + 2});
        scene_.material_index.push_back(from_.material_index[t]);
    }
    const Vec3& corner(std::size_t t, int c) const {
        return from_.positions[from_.triangles[t][c]];
    }
    Scene finish() {
        scene_.summary.faces = scene_.summary.triangles = scene_.triangles.size();
        return std::move(scene_);
    }

private:
    const Scene& from_;
    Scene scene_;
};

/// Whether triangle t belongs to the treated share.
bool chosen(std::size_t t, float share) {
    constexpr std::uint64_t seed = 0x7265;
    return Rng(seed, t).uniform() < share;
}

} // namespace

Setting scaled(Setting setting, float factor) {
    for (Vec3& p : setting.scene.positions)
        p *= factor;
    if (setting.scene.viewpoint) *setting.scene.viewpoint *= factor;
    for (Spotlight& light : setting.lights) {
        light.position *= factor;
        light.intensity *= factor * factor;
    }
    for (SurfacePoint& x : setting.places)
        x.position *= factor;
    return setting;
}

Setting shifted(Setting setting, const Vec3& by) {
    for (Vec3& p : setting.scene.positions)
        p += by;
    if (setting.scene.viewpoint) *setting.scene.viewpoint += by;
    for (Spotlight& light : setting.lights)
        light.position += by;
    for (SurfacePoint& x : setting.places)
        x.position += by;
    return setting;
}

Scene with_other_diagonals(const Scene& scene) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); t += 2) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2),
                   &d = mesh.corner(t + 1, 2);
        assert(a == mesh.corner(t + 1, 0) && c == mesh.corner(t + 1, 1));
        mesh.add(a, b, d, t);
        mesh.add(b, c, d, t);
    }
    return mesh.finish();
}

Scene split_in_four(const Scene& scene) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        const Vec3 ab = 0.5f * (a + b), bc = 0.5f * (b + c), ca = 0.5f * (c + a);
        mesh.add(a, ab, ca, t);
        mesh.add(ab, b, bc, t);
        mesh.add(ca, bc, c, t);
        mesh.add(ab, bc, ca, t);
    }
    return mesh.finish();
}

Scene with_t_junctions(const Scene& scene, float share) {
    constexpr std::uint64_t seed = 0x6a75;
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        if (chosen(t, share)) {
            const Vec3 between = a + (0.2f + 0.6f * Rng(seed, t).uniform()) * (b - a);
            mesh.add(a, between, c, t);
            mesh.add(between, b, c, t);
        } else {
            mesh.add(a, b, c, t);
        }
    }
    return mesh.finish();
}

Scene duplicated(const Scene& scene, float share) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        mesh.add(a, b, c, t);
        if (chosen(t, share)) mesh.add(a, c, b, t);
    }
    return mesh.finish();
}

Scene with_coplanar_faces(const Scene& scene, float share) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        mesh.add(a, b, c, t);
        const Vec3 middle = (a + b + c) / 3.0f;
        if (chosen(t, share))
            mesh.add(0.5f * (a + middle), 0.5f * (b + middle), 0.5f * (c + middle), t);
    }
    return mesh.finish();
}

Scene flipped(const Scene& scene, float share) {
    Scene result = scene;
    for (std::size_t t = 0; t < scene.triangles.size(); ++t)
        if (chosen(t, share)) std::swap(result.triangles[t][1], result.triangles[t][2]);
    return result;
}

Scene with_flat_normals(const Scene& scene, float sign, float share) {
    Scene result = scene;
    result.normals.clear();
    result.normal_indices.clear();
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const auto [a, b, c] = scene.triangles[t];
        const Vec3& origin = scene.positions[a];
        const Vec3 normal = (scene.positions[b] - origin).cross(scene.positions[c] - origin);
        const auto n = static_cast<std::uint32_t>(result.normals.size());
        result.normals.push_back(sign * normal.normalized());
        if (chosen(t, share))
            result.normal_indices.push_back({n, n, n});
        else
            result.normal_indices.push_back({no_index, no_index, no_index});
    }
    return result;
}

} // namespace afterglow
