#include "viewer/geometry_buffer.h"

#include <array>

namespace afterglow {
namespace {

const char* const vertex_shader = R"(
in vec3 position;
in vec3 normal;
in vec2 uv;
uniform mat4 projection;
uniform vec3 eye;
out vec3 x;
out vec3 shading;
out vec2 place;
flat out vec3 from_eye; // to a corner: tells the side more surely than a place in between
void main() {
    x = position;
    from_eye = position - eye;
    shading = normal;
    place = uv;
    gl_Position = projection * vec4(from_eye, 1.0);
}
)";

// The normal's side and when it gives way to the triangle's own: as Surface::point.
const char* const fragment_shader = R"(
in vec3 x;
in vec3 shading;
in vec2 place;
flat in vec3 from_eye;
uniform vec3 eye;
uniform mat3 ray; // direction of the ray through (x, y), in pixels: ray * (x, y, 1)
uniform uint first_triangle;
uniform samplerBuffer triangles;
uniform vec3 reflectance;
uniform bool is_textured;
uniform sampler2D image;
uniform bool has_normal_map;
uniform sampler2D normal_map;
uniform samplerBuffer tangents;
out vec4 out_position;
out vec4 out_normal;
out vec4 out_reflectance;
out uint out_surface;
out vec4 out_shown;

// As mapped_normal().
vec3 mapped_normal(vec3 mapped, vec4 tangent, vec3 normal, vec3 geometric, float side) {
    vec3 front = side * normal;
    vec3 along = tangent.xyz - dot(front, tangent.xyz) * front;
    float size = length(along);
    if (size < 1e-3) return normal;
    vec3 u = along / size, v = tangent.w * cross(front, u);
    vec3 turned = side * (mapped.x * u + mapped.y * v + mapped.z * front);
    float turned_size = length(turned);
    if (turned_size < 1e-3) return normal;
    vec3 n = turned / turned_size;
    float height = dot(n, geometric);
    return height >= 0.01 ? n : normalize(n + (0.01 - height) * geometric);
}

void main() {
    uint triangle = first_triangle + uint(gl_PrimitiveID);
    vec3 geometric = texelFetch(triangles, int(triangle)).xyz;
    bool back_side = dot(geometric, from_eye) > 0.0;
    float side = back_side ? -1.0 : 1.0;
    geometric *= side;
    float size = length(shading);
    vec3 n = size > 1e-3 ? side / size * shading : geometric;
    if (dot(n, geometric) <= 0.01) n = geometric;
    // Interpolation is not exact enough to start rays from: they would meet their own triangle.
    vec3 direction = ray * vec3(gl_FragCoord.xy, 1.0);
    float slope = dot(direction, geometric);
    vec3 place_on_plane = eye + dot(from_eye, geometric) / slope * direction;
    out_position = vec4(abs(slope) > 1e-5 ? place_on_plane : x, 1.0);
    out_normal = vec4(n, 0.0);
    out_shown = out_normal;
    if (has_normal_map) {
        vec4 tangent = texelFetch(tangents, int(triangle));
        if (tangent.xyz != vec3(0.0))
            out_shown.xyz = mapped_normal(texture(normal_map, place).xyz, tangent, n, geometric, side);
    }
    out_reflectance = vec4(reflectance, 1.0);
    if (is_textured) out_reflectance.rgb *= texture(image, place).rgb;
    out_surface = 2u * triangle + (back_side ? 1u : 0u);
}
)";

/// Directions through pixels, not of unit length, as Camera::direction has them; through
/// (x, y) + shift where (x, y) is asked for.
Eigen::Matrix3f pixel_rays(const Camera& camera, const Vec2& shift) {
    const Vec3 right = camera.right(), down = -camera.top();
    const float pixel = camera.pixel_size();
    Eigen::Matrix3f rays;
    rays.col(0) = pixel * right;
    rays.col(1) = pixel * down;
    rays.col(2) = camera.forward() + (shift.x() - 0.5f * static_cast<float>(camera.width)) * pixel * right
                  + (shift.y() - 0.5f * static_cast<float>(camera.height)) * pixel * down;
    return rays;
}

} // namespace

GeometryBuffer::Targets::Targets(const Gl& gl, int w, int h, bool with_shown)
    : width(w), height(h), position(make_texture(gl, float4_texels, w, h)),
      normal(make_texture(gl, float4_texels, w, h)),
      reflectance(make_texture(gl, half4_texels, w, h)),
      surface(make_texture(gl, index_texels, w, h)), depth(make_texture(gl, depth_texels, w, h)),
      shown(with_shown ? make_texture(gl, float4_texels, w, h) : GlName()),
      framebuffer(with_shown
                      ? make_framebuffer(gl, {position, normal, reflectance, surface, shown}, depth)
                      : make_framebuffer(gl, {position, normal, reflectance, surface}, depth)) {}

GeometryBuffer::GeometryBuffer(const Gl& gl)
    : gl_(gl), program_(gl, "geometry", vertex_shader, fragment_shader, {"position", "normal", "uv"},
                        {"out_position", "out_normal", "out_reflectance", "out_surface", "out_shown"}) {}

void GeometryBuffer::draw(const SceneMesh& mesh, const Camera& camera, const Vec2& place) {
    if (!targets_ || targets_->width != camera.width || targets_->height != camera.height)
        targets_.emplace(gl_, camera.width, camera.height, mesh.has_normal_maps());
    camera_ = camera;
    const DepthTest depth(gl_);
    ViewTransform view = view_transform(camera, mesh.farthest(camera.position), depth.reversed());
    // Pixel centres come to show what lies at `place`.
    const Vec2 shift = place - Vec2(0.5f, 0.5f);
    view.projection.row(0) -= 2.0f * shift.x() / static_cast<float>(camera.width) * view.projection.row(3);
    view.projection.row(1) -= 2.0f * shift.y() / static_cast<float>(camera.height) * view.projection.row(3);

    gl_.BindFramebuffer(GL_FRAMEBUFFER, targets_->framebuffer);
    gl_.Viewport(0, 0, camera.width, camera.height);
    const std::array<float, 4> nothing = {0.0f, 0.0f, 0.0f, 0.0f};
    const std::array<GLuint, 4> no_surface = {no_index, 0, 0, 0};
    for (int target = 0; target < 3; ++target) gl_.ClearBufferfv(GL_COLOR, target, nothing.data());
    gl_.ClearBufferuiv(GL_COLOR, 3, no_surface.data());
    if (targets_->shown != 0) gl_.ClearBufferfv(GL_COLOR, 4, nothing.data());
    depth.clear();

    program_.use();
    program_.set("projection", view.projection);
    program_.set("eye", view.eye);
    program_.set("ray", pixel_rays(camera, shift));
    mesh.draw(program_, view, true);
}

const PixelSurfaces& GeometryBuffer::read() {
    const auto size = static_cast<std::size_t>(targets_->width) * static_cast<std::size_t>(targets_->height);
    positions_.resize(size);
    normals_.resize(size);
    surfaces_.resize(size);
    gl_.BindFramebuffer(GL_FRAMEBUFFER, targets_->framebuffer);
    gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
    const auto read_target = [&](GLenum target, const TexelFormat& format, void* to) {
        gl_.ReadBuffer(target);
        gl_.ReadPixels(0, 0, targets_->width, targets_->height, format.format, format.type, to);
    };
    read_target(GL_COLOR_ATTACHMENT0, float4_texels, positions_.data());
    read_target(GL_COLOR_ATTACHMENT1, float4_texels, normals_.data());
    read_target(GL_COLOR_ATTACHMENT3, index_texels, surfaces_.data());
    if (targets_->shown != 0) {
        shown_.resize(size);
        read_target(GL_COLOR_ATTACHMENT4, float4_texels, shown_.data());
    }
    pixels_ = {targets_->width, targets_->height, camera_.position, camera_.pixel_size(),
               positions_,      normals_,         surfaces_};
    return pixels_;
}

} // namespace afterglow
