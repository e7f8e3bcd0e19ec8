#pragma once

#include "core/scene.h"
#include "transport/spotlight.h"

namespace afterglow {

/// The errors that tests of light have to see: a light, or walls, that are brighter by a share.
enum class Fault { none, bright_light, bright_walls };

inline Spotlight with_fault(Spotlight light, Fault fault, double share) {
    if (fault == Fault::bright_light) light.intensity *= static_cast<float>(1.0 + share);
    return light;
}

inline Scene with_fault(Scene scene, Fault fault, double share) {
    if (fault == Fault::bright_walls)
        for (Material& material : scene.materials) material.reflectance *= static_cast<float>(1.0 + share);
    return scene;
}

} // namespace afterglow
