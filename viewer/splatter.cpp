#include "viewer/splatter.h"

#include <algorithm>
#include <array>

namespace afterglow {
namespace {

// DisplayFunction in four texels: vector irradiance 0-3, 4-7, (8, position), (support, normal).
const std::string functions_in_shaders = R"(
uniform samplerBuffer functions;
struct Function { vec3 position, normal; float support; mat3 vector_irradiance; };
Function function_at(int j) {
    vec4 a = texelFetch(functions, 4 * j), b = texelFetch(functions, 4 * j + 1);
    vec4 c = texelFetch(functions, 4 * j + 2), d = texelFetch(functions, 4 * j + 3);
    return Function(c.yzw, d.yzw, d.x, mat3(a.xyz, vec3(a.w, b.xy), vec3(b.zw, c.x)));
}
// Squared share of the support at which x lies, with the squashed distance.
float relative_distance2(Function f, vec3 x) {
    vec3 d = x - f.position;
    float h = dot(d, f.normal);
    return (dot(d, d) + 8.0 * h * h) / (f.support * f.support);
}
)";

const std::string add_vertex_shader = functions_in_shaders + R"(
uniform usamplerBuffer visible;
uniform vec3 eye;
uniform vec3 forward;
uniform vec3 right;
uniform vec3 down;
uniform vec2 half_size; // of the picture at distance one
flat out int number;
void main() {
    number = int(texelFetch(visible, gl_InstanceID).x);
    Function f = function_at(number);
    vec3 d = f.position - eye;
    vec3 c = vec3(dot(d, right), dot(d, down), dot(d, forward));
    float r = f.support;
    vec2 low = vec2(-1.0), high = vec2(1.0);
    // What reaches behind the eye may be anywhere.
    if (c.z - r > 1e-3 * r) {
        vec2 least = c.xy - r, most = c.xy + r;
        low = min(least / (c.z - r), least / (c.z + r)) / half_size;
        high = max(most / (c.z - r), most / (c.z + r)) / half_size;
    }
    gl_Position = vec4((gl_VertexID & 1) == 1 ? high.x : low.x, (gl_VertexID & 2) == 2 ? high.y : low.y, 0.0, 1.0);
}
)";

const std::string add_fragment_shader = functions_in_shaders + R"(
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D shown_normals;
uniform usampler2D patches;
uniform usamplerBuffer row_begin;
uniform usamplerBuffer row_entries; // (function, bits of its factor), functions rising
uniform uint first;
uniform int weight_power;
flat in int number;
out vec4 sum;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uint patch_number = texelFetch(patches, pixel, 0).x;
    if (patch_number == 0xffffffffu) discard;
    Function f = function_at(number);
    vec3 x = texelFetch(positions, pixel, 0).xyz;
    float d2 = relative_distance2(f, x);
    if (d2 >= 1.0) discard;
    vec3 n = texelFetch(normals, pixel, 0).xyz;
    float cosine = dot(n, f.normal);
    if (cosine <= 0.0) discard;
    int low = int(texelFetch(row_begin, int(patch_number)).x);
    int high = int(texelFetch(row_begin, int(patch_number) + 1).x);
    uint wanted = uint(number) + first;
    int end = high;
    while (low < high) {
        int middle = (low + high) / 2;
        if (texelFetch(row_entries, middle).x < wanted) low = middle + 1;
        else high = middle;
    }
    if (low == end) discard;
    uvec2 entry = texelFetch(row_entries, low).xy;
    if (entry.x != wanted) discard;
    float w = ((2.0 * sqrt(d2) - 3.0) * d2 + 1.0) * uintBitsToFloat(entry.y);
    for (int power = weight_power; power > 0; power >>= 1) {
        if ((power & 1) == 1) w *= cosine;
        cosine *= cosine;
    }
    sum = w * vec4(f.vector_irradiance * texelFetch(shown_normals, pixel, 0).xyz, 1.0);
}
)";

const std::string divide_fragment_shader = functions_in_shaders + R"(
uniform sampler2D sums;
uniform sampler2D positions;
uniform sampler2D normals;
uniform sampler2D shown_normals;
uniform usampler2D patches;
uniform usamplerBuffer row_begin;
uniform usamplerBuffer row_entries;
uniform uint first;
out vec4 irradiance;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    irradiance = vec4(0.0);
    uint patch_number = texelFetch(patches, pixel, 0).x;
    if (patch_number == 0xffffffffu) return;
    vec4 sum = texelFetch(sums, pixel, 0);
    if (sum.w > 0.0) {
        irradiance = vec4(max(sum.rgb / sum.w, 0.0), 1.0);
        return;
    }
    // Where no function weighs anything, the closest has it all.
    vec3 x = texelFetch(positions, pixel, 0).xyz;
    float least = 1e30;
    int end = int(texelFetch(row_begin, int(patch_number) + 1).x);
    for (int k = int(texelFetch(row_begin, int(patch_number)).x); k < end; ++k) {
        Function f = function_at(int(texelFetch(row_entries, k).x - first));
        float d2 = relative_distance2(f, x);
        if (d2 >= least) continue;
        least = d2;
        irradiance = vec4(max(f.vector_irradiance * texelFetch(shown_normals, pixel, 0).xyz, 0.0), 1.0);
    }
}
)";

} // namespace

Splatter::Splatter(const Gl& gl)
    : gl_(gl), add_program_(gl, "splat", add_vertex_shader, add_fragment_shader, {}, {"sum"}),
      divide_program_(gl, "divide", whole_picture_vertex_shader, divide_fragment_shader, {},
                      {"irradiance"}),
      vertex_array_(make_vertex_array(gl)), functions_(gl, GL_RGBA32F, 16),
      visible_functions_(gl, GL_R32UI, 4), row_begin_(gl, GL_R32UI, 4), row_entries_(gl, GL_RG32UI, 8) {}

void Splatter::set(const DisplayField& field) {
    static_assert(sizeof(DisplayFunction) == 64);
    functions_.set(field.functions().data(), 4 * field.functions().size());
    first_ = field.first();
    weight_power_ = field.weight_power();
    is_visible_.resize(field.functions().size());
}

void Splatter::copy_patches(const DisplayPatches& patches) {
    static_assert(sizeof(BasisEntry) == 8);
    if (patches.generation() != generation_) rows_there_ = entries_there_ = 0;
    generation_ = patches.generation();
    row_begin_.set(patches.begin().data(), patches.begin().size(), rows_there_);
    row_entries_.set(patches.entries().data(), patches.entries().size(), entries_there_);
    rows_there_ = patches.begin().size();
    entries_there_ = patches.entries().size();
}

void Splatter::find_visible(const DisplayPatches& patches, std::span<const std::uint32_t> patch) {
    is_listed_.assign(patches.patches(), 0);
    std::fill(is_visible_.begin(), is_visible_.end(), 0);
    for (const std::uint32_t p : patch) {
        if (p == no_index || is_listed_[p]) continue;
        is_listed_[p] = 1;
        for (const BasisEntry& entry : patches.functions(p)) is_visible_[entry.index - first_] = 1;
    }
    visible_.clear();
    for (std::uint32_t j = 0; j < is_visible_.size(); ++j)
        if (is_visible_[j]) visible_.push_back(j);
}

void Splatter::draw(const GeometryBuffer& pixels, const Camera& camera, const DisplayPatches& patches,
                    std::span<const std::uint32_t> patch, GLuint framebuffer) {
    const int width = camera.width, height = camera.height;
    if (!targets_ || targets_->width != width || targets_->height != height) {
        targets_.emplace(Targets{width, height, make_texture(gl_, index_texels, width, height),
                                 make_texture(gl_, float4_texels, width, height), {}});
        targets_->framebuffer = make_framebuffer(gl_, {targets_->sums});
    }
    copy_patches(patches);
    find_visible(patches, patch);
    visible_functions_.set(visible_.data(), visible_.size());
    gl_.BindTexture(GL_TEXTURE_2D, targets_->patch);
    gl_.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, index_texels.format, index_texels.type,
                      patch.data());

    const auto bind = [&](const GlProgram& p) {
        p.use();
        p.bind("functions", 0, GL_TEXTURE_BUFFER, functions_.texture());
        p.bind("positions", 1, GL_TEXTURE_2D, pixels.position());
        p.bind("normals", 2, GL_TEXTURE_2D, pixels.normal());
        p.bind("shown_normals", 7, GL_TEXTURE_2D, pixels.shown_normal());
        p.bind("patches", 3, GL_TEXTURE_2D, targets_->patch);
        p.bind("row_begin", 4, GL_TEXTURE_BUFFER, row_begin_.texture());
        p.bind("row_entries", 5, GL_TEXTURE_BUFFER, row_entries_.texture());
        p.set("first", first_);
    };
    gl_.BindVertexArray(vertex_array_);
    gl_.BindFramebuffer(GL_FRAMEBUFFER, targets_->framebuffer);
    gl_.Viewport(0, 0, width, height);
    const std::array<float, 4> nothing = {0.0f, 0.0f, 0.0f, 0.0f};
    gl_.ClearBufferfv(GL_COLOR, 0, nothing.data());
    bind(add_program_);
    add_program_.bind("visible", 6, GL_TEXTURE_BUFFER, visible_functions_.texture());
    const float half = camera.half_height();
    add_program_.set("eye", camera.position);
    add_program_.set("forward", camera.forward());
    add_program_.set("right", camera.right());
    add_program_.set("down", Vec3(-camera.top()));
    add_program_.set("half_size", Vec2(half * static_cast<float>(width) / static_cast<float>(height), half));
    add_program_.set("weight_power", weight_power_);
    gl_.Enable(GL_BLEND);
    gl_.BlendFunc(GL_ONE, GL_ONE);
    gl_.DrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(visible_.size()));
    gl_.Disable(GL_BLEND);

    gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    bind(divide_program_);
    divide_program_.bind("sums", 6, GL_TEXTURE_2D, targets_->sums);
    gl_.DrawArrays(GL_TRIANGLES, 0, 3);
}

} // namespace afterglow
