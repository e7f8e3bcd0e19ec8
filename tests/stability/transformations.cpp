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
    const Vec3& corner(std::size_t t, int c) const { return from_.positions[from_.triangles[t][c]]; }
    Scene finish() {
        scene_.summary.faces = scene_.summary.triangles = scene_.triangles.size();
        return std::move(scene_);
    }

private:
    const Scene& from_;
    Scene scene_;
};

} // namespace

Setting scaled(Setting setting, float factor) {
    for (Vec3& p : setting.scene.positions)
        p *= factor;
    if (setting.scene.viewpoint) *setting.scene.viewpoint *= factor;
    setting.light.position *= factor;
    setting.light.intensity *= factor * factor;
    for (SurfacePoint& x : setting.places)
        x.position *= factor;
    return setting;
}

Setting shifted(Setting setting, const Vec3& by) {
    for (Vec3& p : setting.scene.positions)
        p += by;
    if (setting.scene.viewpoint) *setting.scene.viewpoint += by;
    setting.light.position += by;
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

Scene with_t_junctions(const Scene& scene, std::uint64_t seed) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        if (t % 2 == 0) {
            mesh.add(a, b, c, t);
            continue;
        }
        const Vec3 between = a + (0.2f + 0.6f * Rng(seed, t).uniform()) * (b - a);
        mesh.add(a, between, c, t);
        mesh.add(between, b, c, t);
    }
    return mesh.finish();
}

Scene duplicated(const Scene& scene, bool turned_over) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        mesh.add(a, b, c, t);
        if (turned_over)
            mesh.add(a, c, b, t);
        else
            mesh.add(a, b, c, t);
    }
    return mesh.finish();
}

Scene with_coplanar_faces(const Scene& scene) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Vec3 &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
        mesh.add(a, b, c, t);
        const Vec3 middle = (a + b + c) / 3.0f;
        mesh.add(0.5f * (a + middle), 0.5f * (b + middle), 0.5f * (c + middle), t);
    }
    return mesh.finish();
}

Scene flipped(const Scene& scene) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t)
        mesh.add(mesh.corner(t, 0), mesh.corner(t, 2), mesh.corner(t, 1), t);
    return mesh.finish();
}

Scene flipped_at_random(const Scene& scene, std::uint64_t seed) {
    Remeshed mesh(scene);
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const bool turn = Rng(seed, t).uniform() < 0.5f;
        mesh.add(mesh.corner(t, 0), mesh.corner(t, turn ? 2 : 1), mesh.corner(t, turn ? 1 : 2), t);
    }
    return mesh.finish();
}

Scene with_flat_normals(const Scene& scene, float sign, std::size_t step) {
    Scene result = scene;
    result.normals.clear();
    result.normal_indices.clear();
    for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
        const Triangle& corner = scene.triangles[t];
        const Vec3& a = scene.positions[corner[0]];
        const auto n = static_cast<std::uint32_t>(result.normals.size());
        result.normals.push_back(
            sign
            * (scene.positions[corner[1]] - a).cross(scene.positions[corner[2]] - a).normalized());
        if (t % step == 0)
            result.normal_indices.push_back({n, n, n});
        else
            result.normal_indices.push_back({no_index, no_index, no_index});
    }
    return result;
}

} // namespace afterglow
