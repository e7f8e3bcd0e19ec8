#pragma once

#include "core/surface.h"
#include "core/types.h"

#include <cstdint>
#include <vector>

namespace afterglow {

/// A place where a point of the basis may come to lie.
struct Candidate {
    SurfacePoint at;
    Hit hit; // primitive, side and barycentric weights alone
};

/// Places in the open from which the scene can be looked at: the middle of its largest interior, where light is
/// reflected more than a few times, and one for each further interior that no light from the others reaches. At
/// least one; the centre of the bounding box where nothing better is found.
std::vector<Vec3> find_viewpoints(const Surface& surface, std::uint64_t seed);

/// Importance particles: paths from the viewpoints that reflect diffusely, thirty times at most, and
/// leave a candidate at each bounce after the first three [LZT08, sec. 2.3]. So candidates lie where
/// light that matters can come from, on the side that is looked at. Twelve bytes each.
class CandidateSource {
public:
    /// Throws Error where the scene has 2^31 triangles or more.
    CandidateSource(const Surface& surface, std::vector<Vec3> viewpoints, std::uint64_t seed);

    const Surface& surface() const { return surface_; }
    /// The i-th candidate of an endless sequence; makes more of it while `count` are not there.
    /// Not to be called concurrently. Throws Error where particles find no surface at all.
    void ensure(std::size_t count);
    Candidate operator[](std::size_t i) const;
    std::size_t size() const { return places_.size(); }

    /// Mean length of the particles' segments that end in a candidate [world]: the typical distance
    /// over which light travels here.
    double mean_ray_length() const;
    std::uint64_t rays() const { return rays_; }

private:
    const Surface& surface_;
    std::vector<Vec3> viewpoints_;
    std::uint64_t seed_;
    std::uint64_t next_path_ = 0, rays_ = 0;
    double length_sum_ = 0.0;
    std::uint64_t length_count_ = 0;
    /// What a candidate is made from again: there are tens of millions.
    struct Place {
        std::uint32_t primitive : 31, back_side : 1;
        float u, v;
    };
    std::vector<Place> places_;
};

} // namespace afterglow
