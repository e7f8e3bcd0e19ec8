#pragma once

#include "core/camera.h"
#include "core/types.h"

#include <Eigen/Geometry>

namespace afterglow {

/// From the world to OpenGL's clip space, in two steps so that a scene far from the origin keeps its
/// digits: clip = projection * (x - eye). Pictures are drawn with their first row at y = -1, so that
/// row 0 of a texture is the top of the picture.
struct ViewTransform {
    Vec3 eye = Vec3::Zero();
    Eigen::Matrix4f projection = Eigen::Matrix4f::Identity(); // of x - eye

    /// Whether any part of a box may be seen.
    bool may_see(const Eigen::AlignedBox3f& box) const;
};

/// Of a picture that shows eye + x forward + y right + z down, |y| <= x half_width and |z| <= x
/// half_height; the axes have unit length. `scene_size`: at least the longest way from the eye to what
/// there is to see [world]. Without `reversed_depth`, which needs a clip space with depth from 0 to 1,
/// what is closer than a thousandth of it is not drawn; with it, what is closer than a ten-millionth.
ViewTransform view_transform(const Vec3& eye, const Vec3& forward, const Vec3& right, const Vec3& down,
                             float half_width, float half_height, float scene_size,
                             bool reversed_depth);

/// Of a pinhole camera: the ray through a pixel's centre meets what is drawn there.
ViewTransform view_transform(const Camera& camera, float scene_size, bool reversed_depth);

} // namespace afterglow
