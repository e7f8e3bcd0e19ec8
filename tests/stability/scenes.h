#pragma once

#include "core/scene.h"
#include "core/surface.h"
#include "transport/spotlight.h"

#include <cstdint>
#include <vector>

namespace afterglow {

/// A parallelogram: `corner`, `corner + u`, `corner + u + v`, `corner + v`; its front looks along
/// u x v [m].
struct Quad {
    Vec3 corner, u, v;
    Vec3 normal() const { return u.cross(v).normalized(); }
    /// The same place, seen from behind.
    Quad flipped() const { return {corner, v, u}; }
};

/// `count` places on a quad, in front of it: one in each cell of a grid, about as many cells along
/// u as along v in proportion to their lengths.
std::vector<SurfacePoint> places_on(const Quad& quad, int count, std::uint64_t seed);

/// Puts a scene together, piece by piece. Lengths in metres, y up. All pieces reflect the same,
/// 0.7 if nothing else is said.
class SceneBuilder {
public:
    explicit SceneBuilder(float reflectance = 0.7f);

    void add_triangle(const Vec3& a, const Vec3& b, const Vec3& c);
    void add(const Quad& quad);
    /// Six quads that face outwards.
    void add_box(const Vec3& min, const Vec3& max);
    /// Six quads that face inwards.
    void add_room(const Vec3& min, const Vec3& max);
    /// A wall between two opposite corners: a box, or where it has no extent along one axis, one
    /// quad, whose front looks along that axis.
    void add_wall(const Vec3& min, const Vec3& max);

    Scene finish(const Vec3& viewpoint);

private:
    Scene scene_;
};

/// A scene and the light that shines in it.
struct LitScene {
    Scene scene;
    Spotlight light;
};

// The families' scenes. Walls inside a room reach a little into its shell, so that no light gets
// past their edges.

/// Whether floor, ceiling and side walls are made of quads that end at the wall between two rooms,
/// or run through below it.
enum class Shell { parted, continuous };

/// Two rooms of 4 x 2.8 x 4 m, x in [0, 4] and [4 + wall, 8 + wall], the light in the first. The
/// door, 2 m high, is in the middle of the wall; none where its width is zero.
LitScene two_rooms(float wall, float door_width, Shell shell = Shell::parted);

/// A cube of 5 m with a square sheet, one quad that faces up like the floor, `distance` above the
/// middle of the floor. The light falls on the sheet from above.
LitScene sheet_above_floor(float side, float distance);
/// The floor that the sheet covers, seen from above, and the sheet's underside.
std::vector<Quad> covered_by_sheet(float side, float distance);

/// A rack of boards, 1 m wide, 0.4 m deep and 2 cm thick, at the wall z = 0 of a room of 5 x 2.8 x
/// 4 m, as many as fit below 2 m with `gap` between them.
LitScene shelves(float gap);
/// Upper and lower sides that look into a gap.
std::vector<Quad> shelf_gaps(float gap);

/// A flight of stairs, 1.2 m high and long and 1.5 m wide, in the middle of that room.
LitScene stairs(float rise);
/// Treads and risers.
std::vector<Quad> stair_steps(float rise);

enum class LightAt { outside, inside };

/// A room of 5 x 2.8 x 4 m, whose corner x < 1, z < 1 is closed off by two walls of the given
/// thickness from floor to ceiling; zero: one quad each.
LitScene closed_corner(float wall, LightAt light);
/// A box of 1 m inside, in the middle of a cube of 5 m, with walls of the given thickness (zero:
/// quads), closed or without a lid. Inside: x, y and z in [2, 3].
LitScene box_in_room(float wall, bool lid, LightAt light);
/// The inner sides of the box, the lid's not among them.
std::vector<Quad> inside_of_box();

/// `count` triangles of random place and direction in a room of 5 x 2.8 x 4 m, all of one size;
/// half of their sides together (both sides count) are `area` [m^2].
LitScene clutter(int count, float area, std::uint64_t seed);

/// A corridor 2 m wide and high, x in [0, length], the light at its end x = 0.
LitScene corridor(float length);
/// The four long walls where x is between the two.
std::vector<Quad> corridor_section(float length, float from, float to);

/// A cube of 1 m, open to the front (z = 1), with 2 000 triangles of about 2 cm scattered over its
/// floor; it stands on one triangle that reaches `ground` away in all directions.
LitScene grains_on_ground(float ground);

/// Sixty wires of square section across a room of 5 x 2.8 x 4 m, along x and z, between heights of
/// 0.4 and 2.4 m.
LitScene wires(float thickness);

} // namespace afterglow
