#include "viewer/overlays.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

/// Where ImGui has a pixel: its units are the window's, which may be several pixels wide.
ImVec2 at(const Vec2& p) {
    const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
    return {p.x() / scale.x, p.y() / scale.y};
}

/// Red for positive, blue for negative, white about zero; `x` from -1 to 1.
ImU32 signed_colour(float x) {
    const float strength = std::sqrt(std::clamp(std::abs(x), 0.0f, 1.0f));
    const auto fade = static_cast<int>(255.0f * (1.0f - strength));
    const auto alpha = static_cast<int>(60.0f + 195.0f * strength);
    return x > 0.0f ? IM_COL32(255, fade, fade, alpha) : IM_COL32(fade, fade, 255, alpha);
}

} // namespace

std::optional<Vec2> project(const Camera& camera, const Vec3& x) {
    const Vec3 d = x - camera.position;
    const float ahead = d.dot(camera.forward());
    if (!(ahead > 0.0f)) return {};
    const float scale = 1.0f / (camera.pixel_size() * ahead);
    const Vec2 p(0.5f * static_cast<float>(camera.width) + scale * d.dot(camera.right()),
                 0.5f * static_cast<float>(camera.height) - scale * d.dot(camera.top()));
    if (!(p.x() >= 0.0f && p.y() >= 0.0f && p.x() < static_cast<float>(camera.width) && p.y() < static_cast<float>(camera.height)))
        return {};
    return p;
}

void Overlays::set_light(const Spotlight& light) {
    light_ = light;
    coefficients_.clear();
}

void Overlays::pick(int level, const SurfacePoint& x) {
    const PointHierarchy& points = scene_.file.transfer.points;
    float least = std::numeric_limits<float>::infinity();
    for (std::uint32_t j = points.begin(level); j < points.end(level); ++j) {
        if (x.normal.dot(points.normal.col(j)) <= 0.0f) continue;
        const float d2 = (points.position.col(j) - x.position).squaredNorm();
        if (d2 >= least) continue;
        least = d2;
        picked_ = j;
    }
}

std::optional<Vec2> Overlays::visible(const Camera& camera, const PixelSurfaces& pixels,
                                      std::uint32_t j) const {
    const PointHierarchy& points = scene_.file.transfer.points;
    const Vec3 x = points.position.col(j);
    if ((camera.position - x).dot(points.normal.col(j)) <= 0.0f) return {};
    const std::optional<Vec2> p = project(camera, x);
    if (!p || pixels.surface.empty()) return p;
    const auto pixel = static_cast<std::size_t>(p->y()) * static_cast<std::size_t>(pixels.width)
                       + static_cast<std::size_t>(p->x());
    if (pixel >= pixels.surface.size() || pixels.surface[pixel] == no_index) return {};
    const float distance = (x - camera.position).norm();
    const float seen = (pixels.point(pixel).position - camera.position).norm();
    return seen > 0.98f * distance ? p : std::nullopt;
}

void Overlays::draw_points(ImDrawList& list, int level, const Camera& camera,
                           const PixelSurfaces& pixels, bool with_coefficients) {
    const TransferOperator& transfer = scene_.file.transfer;
    const PointHierarchy& points = transfer.points;
    if (with_coefficients && level >= transfer.sender_levels) return;
    if (with_coefficients && coefficients_.empty() && transfer.kind == OperatorKind::neumann)
        coefficients_ = scene_.transport.coefficients(scene_.transport.direct_radiosity(light_));
    if (with_coefficients && coefficients_.empty()) return;
    const auto value = [&](std::uint32_t j) {
        return coefficients_[4 * j] + coefficients_[4 * j + 1] + coefficients_[4 * j + 2];
    };
    float largest = 0.0f;
    if (with_coefficients)
        for (std::uint32_t j = points.begin(level); j < points.end(level); ++j)
            largest = std::max(largest, std::abs(value(j)));
    const float pixel = camera.pixel_size();
    for (std::uint32_t j = points.begin(level); j < points.end(level); ++j) {
        const std::optional<Vec2> p = visible(camera, pixels, j);
        if (!p) continue;
        const float distance = (points.position.col(j) - camera.position).norm();
        const float radius = 0.25f * points.spacing[level] / (pixel * distance);
        const ImU32 colour = with_coefficients ? signed_colour(largest > 0.0f ? value(j) / largest : 0.0f)
                                               : IM_COL32(255, 210, 60, 220);
        list.AddCircleFilled(at(*p), std::clamp(radius, 1.5f, 9.0f), colour, radius > 3.0f ? 12 : 6);
    }
}

void Overlays::draw_links(ImDrawList& list, const Camera& camera, const PixelSurfaces& pixels) const {
    const TransferOperator& transfer = scene_.file.transfer;
    if (!picked_ || transfer.kind != OperatorKind::neumann) return;
    const std::optional<Vec2> from = project(camera, transfer.points.position.col(*picked_));
    float largest = 0.0f;
    transfer.links.for_each(*picked_, [&](std::uint32_t, const LinkVector& link) { largest = std::max(largest, link.norm()); });
    const Vec3 n = transfer.points.normal.col(*picked_);
    transfer.links.for_each(*picked_, [&](std::uint32_t sender, const LinkVector& link) {
        const std::optional<Vec2> to = visible(camera, pixels, sender);
        if (!to) return;
        const float strength = n.dot(link.head<3>()) / largest;
        if (from && std::abs(strength) > 0.1f) list.AddLine(at(*from), at(*to), IM_COL32(255, 255, 255, 50));
        list.AddCircleFilled(at(*to), 4.0f, signed_colour(strength));
    });
    if (from) list.AddCircle(at(*from), 8.0f, IM_COL32(60, 255, 60, 255), 16, 2.5f);
}

void Overlays::draw(ImDrawList& list, Overlay overlay, int level, const Camera& camera,
                    const PixelSurfaces& pixels) {
    if (overlay == Overlay::points || overlay == Overlay::coefficients)
        draw_points(list, level, camera, pixels, overlay == Overlay::coefficients);
    if (overlay == Overlay::links) draw_links(list, camera, pixels);
}

void draw_light(ImDrawList& list, const Spotlight& light, const Camera& camera, float length) {
    const std::optional<Vec2> p = project(camera, light.position);
    if (!p) return;
    const std::optional<Vec2> end = project(camera, light.position + length * light.direction);
    const ImU32 colour = IM_COL32(255, 220, 90, 255);
    if (end) list.AddLine(at(*p), at(*end), colour, 2.0f);
    list.AddCircleFilled(at(*p), 6.0f, colour, 16);
    list.AddCircle(at(*p), 8.0f, IM_COL32(0, 0, 0, 200), 16, 1.5f);
}

} // namespace afterglow
