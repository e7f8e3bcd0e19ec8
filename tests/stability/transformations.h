#pragma once

#include "core/scene.h"
#include "transport/spotlight.h"

#include <vector>

namespace afterglow {

/// What one asks of the engine: the light that lamps make in a scene, each by itself, at some
/// places.
struct Setting {
    Scene scene;
    std::vector<Spotlight> lights;
    std::vector<SurfacePoint> places;
};

// The following leave irradiance as it is, at the places that move along.

/// All coordinates times `factor`; the lights' intensities times its square.
Setting scaled(Setting setting, float factor);
/// All coordinates plus `by`, rounded to float.
Setting shifted(Setting setting, const Vec3& by);

// The following describe the same surfaces by other triangles, windings and normals. Materials
// stay, texture coordinates are lost. `share`: of the triangles, drawn at random, that are treated.

/// Of scenes of quads alone, as make_room() and the built-in ones make them: the other diagonal.
Scene with_other_diagonals(const Scene& scene);
/// Every triangle cut into four at the middles of its edges.
Scene split_in_four(const Scene& scene);
/// Cut in two somewhere along the first edge, whatever the neighbours do.
Scene with_t_junctions(const Scene& scene, float share);
/// There twice, the second time turned over.
Scene duplicated(const Scene& scene, float share);
/// A smaller triangle lies on them, in their plane.
Scene with_coplanar_faces(const Scene& scene, float share);
/// Wound the other way.
Scene flipped(const Scene& scene, float share);
/// The triangles' own normals at their corners times `sign`; the other triangles have none.
Scene with_flat_normals(const Scene& scene, float sign, float share);

} // namespace afterglow
