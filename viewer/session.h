#pragma once

#include "transport/transfer_scene.h"
#include "viewer/light_solver.h"
#include "viewer/light_thread.h"
#include "viewer/overlays.h"
#include "viewer/renderer.h"

#include <memory>
#include <string>

namespace afterglow {

/// An opened transfer file, ready to be looked at, with a camera and a light that fit its scene.
struct Session {
    /// Errors as of TransferScene and Renderer.
    Session(const Gl& gl, const std::string& path, const std::string& scene_override,
            IndirectMethod method);

    const std::string path;
    const TransferScene scene;
    LightSolver solver;
    Renderer renderer;
    Overlays overlays;
    Camera camera;
    Spotlight light;
    float scene_size; // diagonal of its box [world]
    LightThread light_thread; // last: it stops first
};

} // namespace afterglow
