#include "viewer/session.h"

#include <cmath>

namespace afterglow {
namespace {

/// From the scene's own viewpoint, or a place where points lie, along the widest way.
Camera first_camera(const TransferScene& scene) {
    const PointHierarchy& points = scene.file.transfer.points;
    const Eigen::AlignedBox3f box(points.position.rowwise().minCoeff(), points.position.rowwise().maxCoeff());
    Camera camera;
    Vec3 forward = Vec3::UnitX();
    if (scene.scene.viewpoint) {
        camera.position = *scene.scene.viewpoint;
        forward = box.center() - camera.position;
    } else {
        camera.position = box.center();
        forward = Vec3::Unit(box.sizes().x() > box.sizes().z() ? 0 : 2);
    }
    forward.y() = 0.0f;
    if (!(forward.norm() > 1e-3f * box.sizes().norm())) forward = Vec3::UnitZ();
    // To the first surface, or half through the scene.
    forward.normalize();
    const float far = 0.5f * box.sizes().norm();
    const auto free_way = [&](const Vec3& direction) {
        return std::min(far, scene.surface.closest_hit({camera.position, direction}).distance);
    };
    // With the back to the wall there is most to see.
    camera.position -= 0.8f * free_way(-forward) * forward;
    camera.target = camera.position + 0.8f * free_way(forward) * forward;
    return camera;
}

/// From a little above the camera, bright enough for a room of this size.
Spotlight first_light(const Camera& camera, float scene_size) {
    Spotlight light;
    light.position = camera.position;
    light.direction = camera.target - camera.position + Vec3(0.0f, -0.1f * (camera.target - camera.position).norm(), 0.0f);
    light.inner_angle = 20.0f;
    light.outer_angle = 30.0f;
    light.intensity = Rgb::Constant(0.1f * scene_size * scene_size);
    light.check();
    return light;
}

} // namespace

Session::Session(const Gl& gl, const std::string& file, const std::string& scene_override,
                 IndirectMethod method)
    : path(file), scene(file, scene_override), solver(scene, 1), renderer(gl, scene, method),
      overlays(scene), camera(first_camera(scene)),
      scene_size(scene.scene.bounds().sizes().norm()), light_thread([this](const Spotlight& pose) {
          const Spotlight off = pose.off_surfaces(scene.surface);
          const auto field = solver.solve(off);
          return LitField{off, field, solver.statistics()};
      }) {
    tell_of_outside_files(scene.scene);
    light = first_light(camera, scene_size);
    light_thread.set(light);
}

} // namespace afterglow
