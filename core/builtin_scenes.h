#pragma once

#include "core/scene.h"

#include <string>
#include <utility>
#include <vector>

namespace afterglow {

/// Scenes that need no file, in metres, y up. All are wound so that fronts face the open air, have
/// no vertex normals or textures, and carry a viewpoint.
///
/// builtin:cornell            The Cornell box as measured: x in [0, 0.556], y in [0, 0.5488], z in
///                            [0, 0.5592], open at the front (z = 0; look along +z from
///                            (0.278, 0.273, -0.8)). The red wall is at the large x, the green one
///                            at x = 0; a short block (0.165 high) and a tall one (0.33). No lamp:
///                            the measured one hangs at the ceiling around (0.278, 0.5488, 0.2795).
/// builtin:furnace[:RHO]      The closed box [-1, 1]^3, reflectance RHO in [0, 1), 0.5 if not
/// given. builtin:sphere:RHO         A closed sphere of radius 1 about the origin, 20480 triangles
/// with their
///                            vertices on it, seen from the inside.
/// builtin:two_rooms          Room 1: x in [0, 4], room 2: x in [4.05, 8.05]; both y in [0, 2.8], z
/// in
///                            [0, 4]. Through the wall between them goes a door: y in [0, 2],
///                            z in [1.55, 2.45]. White (0.7), but the far wall x = 8.05 is red.
///                            Closed.
/// builtin:two_rooms_closed   The same without the door: two closed boxes.
///
/// Throws UsageError for an unknown name, listing the known ones, or for an impossible RHO.
Scene make_builtin_scene(const std::string& name);

/// True for every name that starts with "builtin:".
bool is_builtin_scene(const std::string& path_or_name);

/// Each name as it is typed, with one line about it.
std::vector<std::pair<std::string, std::string>> builtin_scene_names();

} // namespace afterglow
