#pragma once

#include "transport/display_patches.h"
#include "transport/transfer_operator.h"

#include <span>
#include <vector>

namespace afterglow {

/// A display level's functions with the vector irradiance at each: all that a pixel reads, one cache
/// line a function, in the order of the GPU's buffer, too.
struct alignas(64) DisplayFunction {
    std::array<float, 9> vector_irradiance = {}; // as VectorIrradiance has it [W/m^2]
    std::array<float, 3> position = {};          // [world]
    float support = 0.0f;                        // [world]
    std::array<float, 3> normal = {};
};

/// The indirect light of one pose of the light, ready to be read at pixels.
class DisplayField {
public:
    /// Of the last level of the hierarchy, without light. Copies what it needs.
    explicit DisplayField(const PointHierarchy& points);

    /// `field` at all points, as from LightTransport::indirect.
    void set(const VectorIrradiance& field);

    std::uint32_t first() const { return first_; } // id of the first function
    int weight_power() const { return weight_power_; } // p of ShepardBasis
    std::span<const DisplayFunction> functions() const { return functions_; }

    /// Indirect irradiance of each pixel [W/m^2], and 1 where it is covered: what Display::irradiance
    /// says, but for what changes within a patch. `patch` as from DisplayPatches::find of the same
    /// pixels; `shading_normal`, with which irradiance is taken, may differ from the pixels' normals.
    void irradiance(const PixelSurfaces& pixels, const DisplayPatches& patches,
                    std::span<const std::uint32_t> patch,
                    std::span<const PixelSurfaces::Float4> shading_normal,
                    std::span<PixelSurfaces::Float4> result) const;

private:
    std::uint32_t first_;
    int weight_power_;
    std::vector<DisplayFunction> functions_;
};

} // namespace afterglow
