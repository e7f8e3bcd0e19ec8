#pragma once

#include "core/scene.h"
#include "core/types.h"

#include <limits>
#include <memory>
#include <span>

namespace afterglow {

struct Ray {
    Vec3 origin;
    Vec3 direction; // unit length
    float length = std::numeric_limits<float>::infinity();
};

/// The closest meeting of a ray with a surface; `primitive` is no_index where there is none.
struct Hit {
    float distance = std::numeric_limits<float>::infinity();
    std::uint32_t primitive = no_index;
    float u = 0, v = 0;      // barycentric weights of the triangle's second and third corner
    bool back_side = false;  // the ray came from the side that the triangle's winding calls back
    float cosine = 1.0f;     // of the angle between the ray and the triangle's normal, >= 0
    explicit operator bool() const { return primitive != no_index; }
};

/// How places were moved onto surfaces.
struct PlacesMoved {
    Index moved = 0, lost = 0; // the latter: where there is no surface
    float farthest = 0.0f;
    PlacesMoved& operator+=(const PlacesMoved& more);
};

/// All that the basis and the transport ask of a scene's geometry: closest hit, occlusion, normal and
/// reflectance [LZT08, sec. 5.1]. Immutable; all queries may run concurrently. Embree stays inside.
class Surface {
public:
    /// Keeps a reference to `scene`, which must outlive it. Throws Error where Embree fails.
    explicit Surface(const Scene& scene);
    ~Surface();
    Surface(const Surface&) = delete;
    Surface& operator=(const Surface&) = delete;

    const Scene& scene() const { return scene_; }
    /// How far ray origins are lifted off a surface along its normal: a few units in the last place
    /// of the largest coordinate, so that a ray neither meets its own start nor leaks through.
    float lift() const { return lift_; }

    Hit closest_hit(const Ray& ray) const;
    /// hits.size() == rays.size(). Packets inside: rays of similar direction should be neighbours. `coherent`,
    /// faster for eight neighbours from one place that are a few degrees apart: slower for others.
    void closest_hits(std::span<const Ray> rays, std::span<Hit> hits, bool coherent = false) const;
    /// True where anything lies on the ray before its length.
    bool occluded(const Ray& ray) const;
    /// True where the segment between two points, each already lifted off its surface, is blocked.
    bool blocked(const Vec3& from, const Vec3& to) const;
    /// The same for many segments at a time, in packets: neighbours should be alike. Three spans of one
    /// size.
    void blocked(std::span<const Vec3> from, std::span<const Vec3> to,
                 std::span<std::uint8_t> result) const;

    /// Position from barycentric weights, and the shading normal (interpolated where the scene has
    /// normals) turned to the side the ray came from.
    SurfacePoint point(const Hit& hit) const;
    /// The normal with which a picture shows the hit, whose point() is x: x.normal, bent by the
    /// material's normal map where there is one and the triangle has texture coordinates; on the same
    /// side of the triangle as x.normal. Light transport and the basis do not see it.
    Vec3 shown_normal(const Hit& hit, const SurfacePoint& x) const;
    /// The triangle's own normal, turned likewise.
    Vec3 geometric_normal(const Hit& hit) const;
    /// Reflectance at the hit, textures included.
    Rgb reflectance(const Hit& hit) const;

    /// Where rays that leave x start.
    Vec3 lifted(const SurfacePoint& x) const { return x.position + lift_ * x.normal; }

    /// Moves places that lie on no surface, such as come from files of few digits, onto the closest one along
    /// their normal, to either side, if that is within a thousandth of the scene's size. What lies at most lift()
    /// behind a surface or twice that in front of it is on it, and stays as it is. Returns how many were moved.
    PlacesMoved move_onto_surfaces(std::span<SurfacePoint> places) const;

private:
    struct Tree;
    const Scene& scene_;
    float lift_, reach_; // the latter: of move_onto_surfaces()
    std::unique_ptr<Tree> tree_;

    Vec2 texture_coordinates(const Hit& hit) const;
};

} // namespace afterglow
