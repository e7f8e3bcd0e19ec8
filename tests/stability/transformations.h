#pragma once

#include "core/scene.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <vector>

namespace afterglow {

/// What one asks of the engine: the light that a lamp makes in a scene, at some places.
struct Setting {
    Scene scene;
    Spotlight light;
    std::vector<SurfacePoint> places;
};

// The following leave irradiance as it is, at the places that move along.

/// All coordinates times `factor`; the light's intensity times its square.
Setting scaled(Setting setting, float factor);
/// All coordinates plus `by`, rounded to float.
Setting shifted(Setting setting, const Vec3& by);

// The following describe the same surfaces by other triangles, windings and normals. Materials stay,
// texture coordinates are lost.

/// Of scenes of quads alone, as make_room() and the built-in ones make them: the other diagonal.
Scene with_other_diagonals(const Scene& scene);
/// Every triangle cut into four at the middles of its edges.
Scene split_in_four(const Scene& scene);
/// Every other triangle cut in two somewhere along its first edge, whatever its neighbours do.
Scene with_t_junctions(const Scene& scene, std::uint64_t seed);
/// Every triangle there twice; the second one turned over, or not.
Scene duplicated(const Scene& scene, bool turned_over);
/// On every triangle lies a smaller one in its plane.
Scene with_coplanar_faces(const Scene& scene);

/// All triangles wound the other way.
Scene flipped(const Scene& scene);
/// Half of the triangles wound the other way.
Scene flipped_at_random(const Scene& scene, std::uint64_t seed);
/// The triangles' own normals at their corners, times `sign`; only every `step`-th triangle has any.
Scene with_flat_normals(const Scene& scene, float sign, std::size_t step = 1);

} // namespace afterglow
