#pragma once

#include "core/camera.h"

namespace afterglow {

/// How a person moves a camera. Angles and shares of the picture come in, so that nothing depends on
/// the window's size; `up` stays what it is, and the view never gets closer to it than 2 degrees. What
/// cannot be (not finite, no length) leaves the camera as it was.
///
/// The way from position to target is the scale of pan and zoom.

/// Turns the camera about `pivot`, by angles [radians] to the right around `up` and upwards.
void orbit(Camera& camera, const Vec3& pivot, float right, float upwards);
/// Turns the view, the position stays.
void look(Camera& camera, float right, float upwards);
/// Moves along the picture, by shares of its height at the target's distance: what lies there follows
/// the pointer.
void pan(Camera& camera, float right, float upwards);
/// Goes towards a place by a factor of the distance to it: 0.5 halves it. It stays where it is in the
/// picture.
void zoom(Camera& camera, const Vec3& towards, float factor);
/// Flies by so much [world] to the right, along `up` and ahead.
void fly(Camera& camera, float right, float upwards, float ahead);

} // namespace afterglow
