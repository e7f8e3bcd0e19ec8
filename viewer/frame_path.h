#pragma once

#include "core/camera.h"
#include "transport/spotlight.h"

#include <string>
#include <vector>

namespace afterglow {

/// A moment of a walk through a scene: where the camera and the light are.
struct Frame {
    double time = 0.0; // [s]
    Camera camera;     // its size in pixels is not part of a path
    Spotlight light;
};

/// Reads a path: a JSON array of
///
///     {"time": 0.04, "camera": {"position": [x, y, z], "target": [x, y, z], "up": [x, y, z], "fov": 50},
///      "light": {"position": [x, y, z], "direction": [x, y, z], "cone": [inner, outer],
///                "intensity": [r, g, b]}}
///
/// What an entry does not say is as in the one before; the first must have both positions, the
/// camera's target and the light's direction. Times must not fall. Throws FileError, which names the
/// entry, for anything else, numbers that are not finite and unknown names included.
std::vector<Frame> read_frame_path(const std::string& path);

/// Writes it, whole or not at all. Throws FileError.
void write_frame_path(const std::string& path, const std::vector<Frame>& frames);

/// The path at a time, between two entries in proportion (directions turned to unit length); before the
/// first and after the last as these are. `frames` must not be empty.
Frame frame_at(const std::vector<Frame>& frames, double time);

} // namespace afterglow
