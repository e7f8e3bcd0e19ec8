#include "viewer/view_transform.h"

namespace afterglow {

bool ViewTransform::may_see(const Eigen::AlignedBox3f& box) const {
    // Outside where all corners lie beyond the same side.
    int left = 0, right = 0, below = 0, above = 0, behind = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 x = box.corner(static_cast<Eigen::AlignedBox3f::CornerType>(corner)) - eye;
        const Eigen::Vector4f c = projection * Eigen::Vector4f(x.x(), x.y(), x.z(), 1.0f);
        left += c.x() < -c.w();
        right += c.x() > c.w();
        below += c.y() < -c.w();
        above += c.y() > c.w();
        behind += c.w() <= 0.0f;
    }
    return left < 8 && right < 8 && below < 8 && above < 8 && behind < 8;
}

ViewTransform view_transform(const Vec3& eye, const Vec3& forward, const Vec3& right, const Vec3& down,
                             float half_width, float half_height, float scene_size,
                             bool reversed_depth) {
    ViewTransform view;
    view.eye = eye;
    view.projection.setZero();
    view.projection.block<1, 3>(0, 0) = right.transpose() / half_width;
    view.projection.block<1, 3>(1, 0) = down.transpose() / half_height;
    view.projection.block<1, 3>(3, 0) = forward.transpose();
    if (reversed_depth) {
        view.projection(2, 3) = 1e-7f * scene_size;
    } else {
        const float near = 1e-3f * scene_size, far = 1.01f * scene_size;
        view.projection.block<1, 3>(2, 0) = (far + near) / (far - near) * forward.transpose();
        view.projection(2, 3) = -2.0f * far * near / (far - near);
    }
    return view;
}

ViewTransform view_transform(const Camera& camera, float scene_size, bool reversed_depth) {
    const float half = camera.half_height();
    const float aspect = static_cast<float>(camera.width) / static_cast<float>(camera.height);
    return view_transform(camera.position, camera.forward(), camera.right(), -camera.top(), half * aspect,
                          half, scene_size, reversed_depth);
}

} // namespace afterglow
