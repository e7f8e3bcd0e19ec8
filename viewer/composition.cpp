#include "viewer/composition.h"

#include "core/error.h"

#include <array>

namespace afterglow {
namespace {

constexpr std::array<const char*, view_layers> names = {"full",       "direct",      "indirect",
                                                        "irradiance", "reflectance", "normals"};

// Layers are numbered as in ViewLayer.
const char* const layer_fragment_shader = R"(
uniform usampler2D surfaces;
uniform sampler2D normals;
uniform sampler2D reflectances;
uniform sampler2D direct;
uniform sampler2D indirect;
uniform int layer;
out vec4 picture;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    picture = vec4(0.0);
    if (texelFetch(surfaces, pixel, 0).x == 0xffffffffu) return;
    vec3 rho = texelFetch(reflectances, pixel, 0).rgb;
    vec3 of_direct = texelFetch(direct, pixel, 0).rgb, of_indirect = texelFetch(indirect, pixel, 0).rgb;
    vec3 result = rho;
    if (layer < 3) {
        vec3 irradiance = (layer != 2 ? of_direct : vec3(0.0)) + (layer != 1 ? of_indirect : vec3(0.0));
        result = rho / 3.14159265358979 * irradiance;
    } else if (layer == 3) {
        result = of_indirect;
    } else if (layer == 5) {
        result = 0.5 * texelFetch(normals, pixel, 0).xyz + 0.5;
    }
    picture = vec4(result, 1.0);
}
)";

// As ToneMap and the writer of PNG files.
const char* const show_fragment_shader = R"(
uniform sampler2D picture;
uniform vec2 corner;
uniform vec2 size;
uniform bool tone_mapped;
uniform float scale;
uniform float white;
out vec4 shown;
void main() {
    vec2 at = (gl_FragCoord.xy - corner) / size;
    ivec2 pixels = textureSize(picture, 0);
    ivec2 pixel = clamp(ivec2(vec2(at.x, 1.0 - at.y) * vec2(pixels)), ivec2(0), pixels - 1);
    vec3 c = scale * texelFetch(picture, pixel, 0).rgb;
    if (tone_mapped) {
        float l = max(0.0, dot(c, vec3(0.2126, 0.7152, 0.0722)));
        c *= (1.0 + l / (white * white)) / (1.0 + l);
    }
    c = clamp(c, 0.0, 1.0);
    shown = vec4(mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308))), 1.0);
}
)";

} // namespace

const char* view_layer_name(ViewLayer layer) { return names[static_cast<std::size_t>(layer)]; }

ViewLayer view_layer_from_name(std::string_view name) {
    std::string all;
    for (std::size_t k = 0; k < names.size(); ++k) {
        if (name == names[k]) return static_cast<ViewLayer>(k);
        all += (k == 0 ? "" : k + 1 < names.size() ? ", " : " and ") + std::string(names[k]);
    }
    throw UsageError("there is no layer \"" + std::string(name) + "\"; there are " + all);
}

Composition::Composition(const Gl& gl)
    : gl_(gl), layer_program_(gl, "layer", whole_picture_vertex_shader, layer_fragment_shader, {},
                              {"picture"}),
      show_program_(gl, "show", whole_picture_vertex_shader, show_fragment_shader, {}, {"shown"}),
      vertex_array_(make_vertex_array(gl)) {}

void Composition::draw(const GeometryBuffer& pixels, GLuint direct, GLuint indirect, ViewLayer layer,
                       int width, int height) {
    if (!target_ || target_->width != width || target_->height != height) {
        target_.emplace(Target{width, height, make_texture(gl_, float4_texels, width, height), {}});
        target_->framebuffer = make_framebuffer(gl_, {target_->picture});
    }
    gl_.BindFramebuffer(GL_FRAMEBUFFER, target_->framebuffer);
    gl_.Viewport(0, 0, width, height);
    layer_program_.use();
    layer_program_.bind("surfaces", 0, GL_TEXTURE_2D, pixels.surface());
    layer_program_.bind("normals", 1, GL_TEXTURE_2D, pixels.shown_normal());
    layer_program_.bind("reflectances", 2, GL_TEXTURE_2D, pixels.reflectance());
    layer_program_.bind("direct", 3, GL_TEXTURE_2D, direct);
    layer_program_.bind("indirect", 4, GL_TEXTURE_2D, indirect);
    layer_program_.set("layer", static_cast<int>(layer));
    gl_.BindVertexArray(vertex_array_);
    gl_.DrawArrays(GL_TRIANGLES, 0, 3);
}

Image Composition::read() const {
    Image image(target_->width, target_->height);
    gl_.BindFramebuffer(GL_FRAMEBUFFER, target_->framebuffer);
    gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl_.ReadBuffer(GL_COLOR_ATTACHMENT0);
    gl_.ReadPixels(0, 0, image.width, image.height, GL_RGB, GL_FLOAT, image.rgb.data());
    return image;
}

void Composition::show(GLuint framebuffer, int x, int y, int width, int height, bool is_light,
                       const std::optional<ToneMap>& tone_map, float exposure) const {
    gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    gl_.Viewport(x, y, width, height);
    show_program_.use();
    show_program_.bind("picture", 0, GL_TEXTURE_2D, target_->picture);
    show_program_.set("corner", Vec2(static_cast<float>(x), static_cast<float>(y)));
    show_program_.set("size", Vec2(static_cast<float>(width), static_cast<float>(height)));
    show_program_.set("tone_mapped", is_light && tone_map ? 1 : 0);
    show_program_.set("scale", !is_light ? 1.0f : tone_map ? tone_map->scale : exposure);
    show_program_.set("white", tone_map ? tone_map->white : 1.0f);
    gl_.BindVertexArray(vertex_array_);
    gl_.DrawArrays(GL_TRIANGLES, 0, 3);
}

} // namespace afterglow
