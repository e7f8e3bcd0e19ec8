#include "viewer/renderer.h"

#include "core/error.h"
#include "core/seconds.h"
#include "transport/renderer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <string>
#include <utility>

namespace afterglow {
namespace {

bool shadows_alike(const Spotlight& a, const Spotlight& b) {
    return a.position == b.position && a.direction == b.direction && a.outer_angle == b.outer_angle;
}

} // namespace

FrameTimings& FrameTimings::operator+=(const FrameTimings& more) {
    geometry += more.geometry;
    shadow_map += more.shadow_map;
    direct += more.direct;
    patches += more.patches;
    indirect += more.indirect;
    composition += more.composition;
    return *this;
}

const char* indirect_method_name(IndirectMethod method) {
    switch (method) {
    case IndirectMethod::splat: return "splat";
    case IndirectMethod::gather: return "gather";
    default: return "auto";
    }
}

IndirectMethod indirect_method_from_name(std::string_view name) {
    for (const auto method : {IndirectMethod::splat, IndirectMethod::gather, IndirectMethod::automatic})
        if (name == indirect_method_name(method)) return method;
    throw UsageError("indirect light comes by splat, gather or auto, not by \"" + std::string(name) + "\"");
}

Renderer::Renderer(const Gl& gl, const TransferScene& scene, IndirectMethod method)
    : gl_(gl), mesh_(gl, scene.scene), geometry_(gl), shadow_map_(gl), splatter_(gl),
      composition_(gl),
      basis_(scene.file.transfer.points, scene.surface,
             scene.file.transfer.kind == OperatorKind::neumann, scene.file.transfer.points.levels() - 1),
      patches_(basis_, scene.file.transfer.points.levels() - 1, {}), method_(method) {}

template <class Stage>
double Renderer::measured(const Stage& stage) const {
    const auto start = std::chrono::steady_clock::now();
    stage();
    gl_.Finish();
    return seconds_since(start);
}

void Renderer::set_light(const Spotlight& light, std::shared_ptr<const DisplayField> field) {
    if (!field_ || !shadows_alike(light, light_)) shadow_map_is_old_ = true;
    light_ = light;
    field_ = std::move(field);
    direct_is_old_ = indirect_is_old_ = splatter_is_old_ = true;
}

void Renderer::set_method(IndirectMethod method) {
    method_ = method;
    indirect_is_old_ = true;
}

Image Renderer::average(const Camera& camera, ViewLayer layer, int samples) {
    Image mean(camera.width, camera.height);
    FrameTimings all;
    for (const Vec2& place : pixel_pattern(samples)) {
        draw(camera, layer, DisplayPatches::no_limit, place);
        all += timings_;
        const Image one = read();
        std::transform(one.rgb.begin(), one.rgb.end(), mean.rgb.begin(), mean.rgb.begin(), std::plus<>());
    }
    for (float& value : mean.rgb) value /= static_cast<float>(samples);
    timings_ = all;
    return mean;
}

void Renderer::draw(const Camera& camera, ViewLayer layer, std::size_t most_new, const Vec2& place) {
    timings_ = {};
    if (camera_ != camera || place != place_) draw_geometry(camera, place);
    const bool wants_direct = layer == ViewLayer::full || layer == ViewLayer::direct;
    if (field_ && wants_direct) draw_direct();
    if (field_ && has_indirect_light(layer)) {
        if (patches_are_old_ || patches_missing_ > 0) find_patches(most_new);
        if (indirect_is_old_) draw_indirect();
    }
    timings_.composition = measured([&] {
        composition_.draw(geometry_, targets_->direct, targets_->indirect, layer, camera.width, camera.height);
    });
}

void Renderer::draw_geometry(const Camera& camera, const Vec2& place) {
    timings_.geometry = measured([&] { geometry_.draw(mesh_, camera, place); });
    if (!targets_ || targets_->width != camera.width || targets_->height != camera.height) {
        const auto texture = [&] { return make_texture(gl_, float4_texels, camera.width, camera.height); };
        targets_.emplace(Targets{camera.width, camera.height, texture(), {}, texture(), {}});
        targets_->direct_framebuffer = make_framebuffer(gl_, {targets_->direct});
        targets_->indirect_framebuffer = make_framebuffer(gl_, {targets_->indirect});
        // Dark until there is light.
        const std::array<float, 4> dark = {0.0f, 0.0f, 0.0f, 0.0f};
        for (const GlName* target : {&targets_->direct_framebuffer, &targets_->indirect_framebuffer}) {
            gl_.BindFramebuffer(GL_FRAMEBUFFER, *target);
            gl_.ClearBufferfv(GL_COLOR, 0, dark.data());
        }
    }
    camera_ = camera;
    place_ = place;
    pixels_ = nullptr;
    direct_is_old_ = indirect_is_old_ = patches_are_old_ = true;
}

void Renderer::draw_direct() {
    if (shadow_map_is_old_) timings_.shadow_map = measured([&] { shadow_map_.draw(mesh_, light_); });
    if (direct_is_old_)
        timings_.direct = measured([&] {
            shadow_map_.shade(mesh_, light_, geometry_, targets_->direct_framebuffer, targets_->width, targets_->height);
        });
    shadow_map_is_old_ = direct_is_old_ = false;
}

void Renderer::find_patches(std::size_t most_new) {
    timings_.patches = measured([&] {
        patches_missing_ = patches_are_old_ ? patches_.find(pixels(), most_new, patch_)
                                            : patches_.refine(pixels(), most_new, patch_);
    });
    patches_are_old_ = false;
    indirect_is_old_ = true;
}

void Renderer::draw_indirect() {
    if (method_ == IndirectMethod::automatic) {
        // Each twice: the first time shaders are translated and memory is found.
        double splatting = 0.0, gathering = 0.0;
        for (int k = 0; k < 2; ++k) {
            splatting = measured([&] { splat(); });
            gathering = measured([&] { gather(); });
        }
        method_ = splatting < gathering ? IndirectMethod::splat : IndirectMethod::gather;
    }
    timings_.indirect = measured([&] {
        if (method_ == IndirectMethod::splat)
            splat();
        else
            gather();
    });
    indirect_is_old_ = false;
}

const PixelSurfaces& Renderer::pixels() {
    if (!pixels_) pixels_ = &geometry_.read();
    return *pixels_;
}

void Renderer::splat() {
    if (splatter_is_old_) splatter_.set(*field_);
    splatter_is_old_ = false;
    splatter_.draw(geometry_, *camera_, patches_, patch_, targets_->indirect_framebuffer);
}

void Renderer::gather() {
    gathered_.resize(patch_.size());
    field_->irradiance(pixels(), patches_, patch_, geometry_.shown_normals(), gathered_);
    gl_.BindTexture(GL_TEXTURE_2D, targets_->indirect);
    gl_.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, targets_->width, targets_->height, float4_texels.format,
                      float4_texels.type, gathered_.data());
}

std::size_t Renderer::uncovered_pixels() const {
    return static_cast<std::size_t>(std::count_if(patch_.begin(), patch_.end(), [&](std::uint32_t p) {
        return p != no_index && patches_.functions(p).empty();
    }));
}

} // namespace afterglow
