#include "viewer/shadow_map.h"

#include "core/error.h"

#include <cmath>
#include <string>

namespace afterglow {
namespace {

constexpr float widest_single = 45.0f; // half-angle of the cone [degrees]
constexpr int side = 2048; // of a picture [texels]
constexpr float margin = 4.0f; // texels around what is needed, for the blend

const char* const distance_vertex_shader = R"(
in vec3 position;
in vec3 normal;
in vec2 uv;
uniform mat4 projection;
uniform vec3 eye;
out vec3 from_light;
void main() {
    from_light = position - eye;
    gl_Position = projection * vec4(from_light, 1.0);
}
)";

const char* const distance_fragment_shader = R"(
in vec3 from_light;
out float distance_from_light;
void main() { distance_from_light = length(from_light); }
)";

const char* const shade_fragment_shader = R"(
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D shown_normals;
uniform usampler2D surfaces;
uniform samplerBuffer triangles;
uniform sampler2DArray distances;
uniform int face_count;
uniform vec3 forward[6];
uniform vec3 right[6];
uniform vec3 down[6];
uniform float half_width;
uniform vec3 light_position;
uniform vec3 light_direction;
uniform vec3 intensity;
uniform float cos_outer;
uniform float falloff_width; // 0: a hard cone
out vec4 irradiance;

float falloff(float c) {
    if (falloff_width == 0.0) return c >= cos_outer ? 1.0 : 0.0;
    float t = clamp((c - cos_outer) / falloff_width, 0.0, 1.0);
    return t * t;
}

float visibility(vec3 from_light, vec3 plane) {
    int face = 0;
    for (int k = 1; k < face_count; ++k)
        if (dot(from_light, forward[k]) > dot(from_light, forward[face])) face = k;
    float ahead = dot(from_light, forward[face]);
    if (ahead <= 0.0) return 0.0;
    vec2 at = vec2(dot(from_light, right[face]), dot(from_light, down[face])) / (ahead * half_width);
    ivec2 size = textureSize(distances, 0).xy;
    vec2 texel = (0.5 * at + 0.5) * vec2(size) - 0.5;
    ivec2 corner = ivec2(floor(texel));
    vec2 blend = texel - vec2(corner);
    float height = dot(from_light, plane);
    float r = length(from_light);
    float texel_size = 2.0 * half_width / float(size.x) * ahead;
    float lit = 0.0;
    for (int k = 0; k < 4; ++k) {
        ivec2 p = corner + ivec2(k & 1, k >> 1);
        vec2 centre = (2.0 * (vec2(p) + 0.5) / vec2(size) - 1.0) * half_width;
        vec3 ray = normalize(forward[face] + centre.x * right[face] + centre.y * down[face]);
        float slope = dot(ray, plane);
        // Where the plane is seen along itself its distance says nothing; and what is farther than
        // the pixel cannot be in its way.
        float on_plane = abs(slope) > 1e-4 ? clamp(height / slope, 0.8 * r, r) : r;
        float seen = texelFetch(distances, ivec3(clamp(p, ivec2(0), size - 1), face), 0).x;
        float weight = ((k & 1) == 1 ? blend.x : 1.0 - blend.x) * ((k >> 1) == 1 ? blend.y : 1.0 - blend.y);
        if (seen == 0.0 || seen > on_plane - 0.5 * texel_size - 2e-4 * r) lit += weight;
    }
    return lit;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    irradiance = vec4(0.0);
    uint surface = texelFetch(surfaces, pixel, 0).x;
    if (surface == 0xffffffffu) return;
    vec3 from_light = texelFetch(positions, pixel, 0).xyz - light_position;
    float squared = dot(from_light, from_light);
    if (squared == 0.0) return;
    vec3 direction = from_light * inversesqrt(squared);
    float cos_surface = -dot(direction, texelFetch(shown_normals, pixel, 0).xyz);
    if (dot(direction, texelFetch(normals, pixel, 0).xyz) >= 0.0) return;
    float share = falloff(dot(direction, light_direction));
    if (cos_surface <= 0.0 || share == 0.0) return;
    // The plane that is lit, on the viewer's side: seen from behind, it shadows itself.
    vec3 plane = texelFetch(triangles, int(surface >> 1)).xyz * ((surface & 1u) == 1u ? -1.0 : 1.0);
    if (dot(plane, direction) >= 0.0) return;
    irradiance.rgb = intensity * (share * cos_surface / squared * visibility(from_light, plane));
}
)";

} // namespace

ShadowMap::ShadowMap(const Gl& gl)
    : gl_(gl), distance_program_(gl, "distance", distance_vertex_shader, distance_fragment_shader,
                                 {"position", "normal", "uv"}, {"distance_from_light"}),
      shade_program_(gl, "spotlight", whole_picture_vertex_shader, shade_fragment_shader, {},
                     {"irradiance"}),
      vertex_array_(make_vertex_array(gl)) {}

void ShadowMap::prepare(int layers) {
    if (layers == layers_) return;
    distances_ = make_texture_name(gl_);
    gl_.BindTexture(GL_TEXTURE_2D_ARRAY, distances_);
    gl_.TexImage3D(GL_TEXTURE_2D_ARRAY, 0, GL_R32F, side, side, layers, 0, GL_RED, GL_FLOAT, nullptr);
    gl_.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl_.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl_.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAX_LEVEL, 0);
    depth_ = make_texture(gl_, depth_texels, side, side);
    framebuffer_ = make_framebuffer(gl_, {}, depth_);
    const GLenum colour = GL_COLOR_ATTACHMENT0;
    gl_.DrawBuffers(1, &colour);
    layers_ = layers;
}

void ShadowMap::draw(const SceneMesh& mesh, const Spotlight& light) {
    faces_.clear();
    float half_angle = 45.0f;
    if (light.outer_angle <= widest_single) {
        const Vec3 right = light.direction.unitOrthogonal();
        faces_.push_back({light.direction, right, right.cross(light.direction)});
        half_angle = light.outer_angle;
        prepare(1);
    } else {
        // No face is farther from its centre than 54.74 degrees.
        for (int axis = 0; axis < 3; ++axis)
            for (const float sign : {-1.0f, 1.0f}) {
                const Vec3 forward = sign * Vec3::Unit(axis);
                if (forward.dot(light.direction) < cos_degrees(std::min(180.0f, light.outer_angle + 55.0f)))
                    continue;
                const Vec3 right = Vec3::Unit((axis + 1) % 3);
                faces_.push_back({forward, right, right.cross(forward)});
            }
        prepare(6);
    }
    half_width_ = std::tan(half_angle * static_cast<float>(EIGEN_PI / 180.0))
                  / (1.0f - 2.0f * margin / static_cast<float>(side));

    const DepthTest depth(gl_);
    gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
    gl_.Viewport(0, 0, side, side);
    distance_program_.use();
    for (std::size_t k = 0; k < faces_.size(); ++k) {
        gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, distances_, 0, static_cast<GLint>(k));
        if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
            throw Error("OpenGL cannot draw a shadow map of floats (" + gl_.renderer() + ")");
        const std::array<float, 4> nothing = {0.0f, 0.0f, 0.0f, 0.0f};
        gl_.ClearBufferfv(GL_COLOR, 0, nothing.data());
        depth.clear();
        const ViewTransform view =
            view_transform(light.position, faces_[k].forward, faces_[k].right, faces_[k].down,
                           half_width_, half_width_, mesh.farthest(light.position), depth.reversed());
        distance_program_.set("projection", view.projection);
        distance_program_.set("eye", view.eye);
        mesh.draw(distance_program_, view, false);
    }
}

void ShadowMap::shade(const SceneMesh& mesh, const Spotlight& light, const GeometryBuffer& pixels,
                      GLuint framebuffer, int width, int height) {
    gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    gl_.Viewport(0, 0, width, height);
    const GlProgram& p = shade_program_;
    p.use();
    p.bind("positions", 0, GL_TEXTURE_2D, pixels.position());
    p.bind("normals", 1, GL_TEXTURE_2D, pixels.normal());
    p.bind("surfaces", 2, GL_TEXTURE_2D, pixels.surface());
    p.bind("triangles", 3, GL_TEXTURE_BUFFER, mesh.triangle_normals());
    p.bind("shown_normals", 5, GL_TEXTURE_2D, pixels.shown_normal());
    p.bind("distances", 4, GL_TEXTURE_2D_ARRAY, distances_);
    p.set("face_count", static_cast<int>(faces_.size()));
    for (std::size_t k = 0; k < faces_.size(); ++k) {
        const auto set = [&](const char* array, const Vec3& value) {
            std::string element(array);
            element += '[';
            element += std::to_string(k);
            element += ']';
            p.set(element.c_str(), value);
        };
        set("forward", faces_[k].forward);
        set("right", faces_[k].right);
        set("down", faces_[k].down);
    }
    p.set("half_width", half_width_);
    p.set("light_position", light.position);
    p.set("light_direction", light.direction);
    p.set("intensity", light.intensity);
    p.set("cos_outer", cos_degrees(light.outer_angle));
    // As Spotlight::falloff.
    p.set("falloff_width", light.inner_angle == light.outer_angle
                               ? 0.0f
                               : std::max(0.001f, cos_degrees(light.inner_angle) - cos_degrees(light.outer_angle)));
    gl_.BindVertexArray(vertex_array_);
    gl_.DrawArrays(GL_TRIANGLES, 0, 3);
}

} // namespace afterglow
