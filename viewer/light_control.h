#pragma once

#include "core/camera.h"
#include "transport/spotlight.h"

#include <string>

namespace afterglow {

/// How a person moves a light. What cannot be leaves it as it was.

/// Moves it along the camera's picture, by shares of the picture's height at the light's distance: it
/// follows the pointer.
void move_along_view(Spotlight& light, const Camera& camera, float right, float upwards);
/// Turns it to a place.
void aim(Spotlight& light, const Vec3& at);
/// Widens or narrows the cone, inner and outer angle alike; within 0.5 and 180 degrees.
void widen(Spotlight& light, float factor);
/// Puts it where the camera is, shining where that looks.
void put_at_camera(Spotlight& light, const Camera& camera);

/// Camera and light as options of `afterglow render`.
std::string command_line(const Camera& camera, const Spotlight& light);

} // namespace afterglow
