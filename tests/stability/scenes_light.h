#pragma once

#include "core/scene.h"
#include "transport/spotlight.h"

#include <array>
#include <vector>

namespace afterglow {

/// A room of 5 x 2.8 x 4 m, x, y and z from 0, y up: white, the wall x = 0 red, the wall z = 4
/// blue; on its floor a turned cabinet and a table with one leg. All surfaces are quads of two
/// consecutive triangles, (a, b, c) and (a, c, d), whose fronts face the air.
struct RoomShape {
    /// How far all walls go on beyond the room's edges [m]; they cross each other.
    float overhang = 0.0f;
    /// How far furniture reaches below the floor [m]; the table's leg then goes into its top.
    float sunken = 0.0f;
    /// Height of an opening from the top of each of the walls x = 0, x = 5, z = 0, z = 4, and of
    /// the ceiling from its x = 5 side, as a share of the wall; 1: the wall is missing.
    std::array<float, 5> open = {0, 0, 0, 0, 0};
};

Scene make_room(const RoomShape& shape = {});

/// Sees all of the room but what its furniture hides.
inline const Vec3 eye_in_room(2.5f, 1.5f, 2.0f);

/// A level square board of the given side, 1 cm thick, white, about `middle`.
void add_board(Scene& room, const Vec3& middle, float side);

/// Hang in the room and shine down, to the walls and onto the furniture, each about as bright. The
/// first hangs in the middle below the ceiling. What an operator does to one of them by chance, it
/// hardly does to another.
std::vector<Spotlight> room_lights();

} // namespace afterglow
