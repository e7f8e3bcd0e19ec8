#include "core/surface.h"

#include "core/embree.h"
#include "core/error.h"
#include "core/normal_map.h"
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <new>

namespace afterglow {

struct Surface::Tree {
    RTCDevice device = nullptr;
    RTCScene scene = nullptr;
    ~Tree() {
        if (scene) rtcReleaseScene(scene);
        if (device) rtcReleaseDevice(device);
    }
};

namespace {

RTCRay to_embree(const Ray& ray) {
    RTCRay r{};
    r.org_x = ray.origin.x(), r.org_y = ray.origin.y(), r.org_z = ray.origin.z();
    r.dir_x = ray.direction.x(), r.dir_y = ray.direction.y(), r.dir_z = ray.direction.z();
    r.tnear = 0.0f;
    r.tfar = ray.length;
    r.mask = ~0u;
    return r;
}

/// How a ray meets a triangle of this normal, of any length.
struct Facing {
    bool back_side;
    float cosine; // see Hit

    Facing(float x, float y, float z, const Vec3& direction) {
        // In double: the squares of large and small triangles' normals are beyond floats.
        const Eigen::Vector3d normal(x, y, z);
        const double along = normal.dot(direction.cast<double>()), length = normal.norm();
        back_side = along > 0.0;
        cosine = length > 0.0 ? static_cast<float>(std::abs(along) / length) : 1.0f;
    }
};

constexpr std::size_t packet_width = 8;
/// Of the lift: how far the sides of triangles are moved out. Enough for the rounding of a ray that
/// starts in the scene, and not as far as rays start off a surface.
constexpr float growth_share = 0.25f;

/// The corners of a triangle with its sides moved out by `distance`; a sharp corner by less than its
/// sides would meet at.
std::array<Vec3, 3> grown(const std::array<Vec3, 3>& corner, float distance) {
    constexpr float least_sine = 0.25f;
    std::array<Vec3, 3> result = corner;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3 from_next = (corner[k] - corner[(k + 1) % 3]).stableNormalized();
        const Vec3 from_last = (corner[k] - corner[(k + 2) % 3]).stableNormalized();
        const float sine = std::max(least_sine, from_next.cross(from_last).norm());
        result[k] += distance / sine * (from_next + from_last);
    }
    return result;
}

void put(RTCRay8& packet, std::size_t k, const Ray& ray) {
    packet.org_x[k] = ray.origin.x();
    packet.org_y[k] = ray.origin.y();
    packet.org_z[k] = ray.origin.z();
    packet.dir_x[k] = ray.direction.x();
    packet.dir_y[k] = ray.direction.y();
    packet.dir_z[k] = ray.direction.z();
    packet.tnear[k] = 0.0f;
    packet.tfar[k] = ray.length;
    packet.time[k] = 0.0f;
    packet.mask[k] = ~0u;
    packet.id[k] = 0;
    packet.flags[k] = 0;
}

} // namespace

Surface::Surface(const Scene& scene) : scene_(scene), tree_(std::make_unique<Tree>()) {
    const Eigen::AlignedBox3f box = scene.bounds();
    const float largest = std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
    lift_ = std::max(largest * 0x1p-19f, std::numeric_limits<float>::min());
    reach_ = std::max(1e-3f * box.sizes().maxCoeff(), 8.0f * lift_);

    tree_->device = rtcNewDevice(nullptr);
    if (!tree_->device)
        throw Error("Embree cannot start; it needs some memory, and to be allowed to start threads");
    tree_->scene = rtcNewScene(tree_->device);
    if (!tree_->scene) throw std::bad_alloc();
    rtcSetSceneBuildQuality(tree_->scene, RTC_BUILD_QUALITY_HIGH);

    // Triangles of their own corners, each a little larger than it is: so that no ray slips through
    // between two. Embree's robust mode does the same for up to twice the time of every ray.
    const std::size_t count = scene.triangles.size();
    RTCGeometry mesh = rtcNewGeometry(tree_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), std::max<std::size_t>(1, 3 * count)));
    auto* indices = static_cast<std::uint32_t*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t), std::max<std::size_t>(1, count)));
    if (!vertices || !indices) {
        rtcReleaseGeometry(mesh);
        throw std::bad_alloc();
    }
    const float growth = growth_share * lift_;
    parallel_for(static_cast<Index>(count), [&](Index t) {
        std::array<Vec3, 3> corner;
        for (std::size_t k = 0; k < 3; ++k)
            corner[k] = scene.positions[scene.triangles[t][k]];
        corner = grown(corner, growth);
        for (std::size_t k = 0; k < 3; ++k) {
            std::copy_n(corner[k].data(), 3, vertices + 9 * t + 3 * k);
            indices[3 * t + k] = static_cast<std::uint32_t>(3 * t + k);
        }
    }, 4096);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(tree_->scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(tree_->scene);
    const RTCError error = rtcGetDeviceError(tree_->device);
    if (error == RTC_ERROR_OUT_OF_MEMORY) throw std::bad_alloc();
    if (error != RTC_ERROR_NONE)
        throw Error("Embree cannot build its tree over " + std::to_string(scene.triangles.size())
                    + " triangles (error " + std::to_string(error) + "); is there enough memory?");
}

Surface::~Surface() = default;

Hit Surface::closest_hit(const Ray& ray) const {
    RTCRayHit query{};
    query.ray = to_embree(ray);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    embree_intersect(tree_->scene, query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    const Facing facing(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z, ray.direction);
    return {query.ray.tfar, query.hit.primID, query.hit.u, query.hit.v, facing.back_side, facing.cosine};
}

void Surface::closest_hits(std::span<const Ray> rays, std::span<Hit> hits, bool coherent) const {
    alignas(32) int valid[packet_width];
    alignas(32) RTCRayHit8 packet;
    for (std::size_t begin = 0; begin < rays.size(); begin += packet_width) {
        const std::size_t count = std::min(packet_width, rays.size() - begin);
        for (std::size_t k = 0; k < packet_width; ++k) {
            valid[k] = k < count ? -1 : 0;
            put(packet.ray, k, rays[begin + std::min(k, count - 1)]);
            packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        }
        embree_intersect(valid, tree_->scene, packet, coherent);
        for (std::size_t k = 0; k < count; ++k) {
            Hit& hit = hits[begin + k];
            if (packet.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) {
                hit = {};
                continue;
            }
            const Facing facing(packet.hit.Ng_x[k], packet.hit.Ng_y[k], packet.hit.Ng_z[k],
                                rays[begin + k].direction);
            hit = {packet.ray.tfar[k], packet.hit.primID[k], packet.hit.u[k], packet.hit.v[k],
                   facing.back_side,   facing.cosine};
        }
    }
}

bool Surface::occluded(const Ray& ray) const {
    RTCRay query = to_embree(ray);
    embree_occluded(tree_->scene, query);
    return query.tfar < 0.0f;
}

bool Surface::blocked(const Vec3& from, const Vec3& to) const {
    const Vec3 step = to - from;
    const float length = step.norm();
    if (!(length > 0.0f)) return false;
    return occluded({from, step / length, length});
}

void Surface::blocked(std::span<const Vec3> from, std::span<const Vec3> to,
                      std::span<std::uint8_t> result) const {
    alignas(32) int valid[packet_width];
    alignas(32) RTCRay8 packet;
    for (std::size_t begin = 0; begin < from.size(); begin += packet_width) {
        const std::size_t count = std::min(packet_width, from.size() - begin);
        for (std::size_t k = 0; k < packet_width; ++k) {
            const std::size_t i = begin + std::min(k, count - 1);
            const Vec3 step = to[i] - from[i];
            const float length = step.norm();
            valid[k] = k < count && length > 0.0f ? -1 : 0;
            put(packet, k, {from[i], step / length, length});
        }
        embree_occluded(valid, tree_->scene, packet);
        for (std::size_t k = 0; k < count; ++k) result[begin + k] = valid[k] != 0 && packet.tfar[k] < 0.0f;
    }
}

Vec3 Surface::geometric_normal(const Hit& hit) const {
    const Vec3 n = scene_.triangle_normal(hit.primitive);
    return hit.back_side ? Vec3(-n) : n;
}

SurfacePoint Surface::point(const Hit& hit) const {
    const Triangle& t = scene_.triangles[hit.primitive];
    const float w = 1.0f - hit.u - hit.v;
    SurfacePoint x;
    x.position = w * scene_.positions[t[0]] + hit.u * scene_.positions[t[1]]
                 + hit.v * scene_.positions[t[2]];
    const Vec3 geometric = geometric_normal(hit);
    x.normal = geometric;
    if (!scene_.normal_indices.empty()) {
        const Triangle& n = scene_.normal_indices[hit.primitive];
        if (n[0] != no_index) {
            const Vec3 sum = w * scene_.normals[n[0]] + hit.u * scene_.normals[n[1]]
                             + hit.v * scene_.normals[n[2]];
            const float length = sum.norm();
            // A normal across the surface's own plane says nothing of the side that is seen.
            if (length > 1e-6f) {
                const Vec3 shading = (hit.back_side ? -sum : sum) / length;
                if (shading.dot(geometric) > 0.01f) x.normal = shading;
            }
        }
    }
    return x;
}

PlacesMoved& PlacesMoved::operator+=(const PlacesMoved& more) {
    moved += more.moved;
    lost += more.lost;
    farthest = std::max(farthest, more.farthest);
    return *this;
}

PlacesMoved Surface::move_onto_surfaces(std::span<SurfacePoint> places) const {
    return parallel_sum(static_cast<Index>(places.size()), PlacesMoved(), [&](Index i) -> PlacesMoved {
        SurfacePoint& x = places[static_cast<std::size_t>(i)];
        if (occluded({lifted(x), -x.normal, 3.0f * lift_})) return {};
        const Hit above = closest_hit({x.position, x.normal, reach_}), below = closest_hit({x.position, -x.normal, reach_});
        if (!above && !below) return {.lost = 1};
        const Hit& closest = above.distance < below.distance ? above : below;
        x.position = point(closest).position;
        return {.moved = 1, .farthest = closest.distance};
    }, 512);
}

Rgb Surface::reflectance(const Hit& hit) const {
    const Material& material = scene_.materials[scene_.material_index[hit.primitive]];
    if (material.texture == no_index || scene_.texture_indices.empty()) return material.reflectance;
    if (scene_.texture_indices[hit.primitive][0] == no_index) return material.reflectance;
    return material.reflectance
           * scene_.textures[material.texture].sample(texture_coordinates(hit));
}

Vec3 Surface::shown_normal(const Hit& hit, const SurfacePoint& x) const {
    const Material& material = scene_.materials[scene_.material_index[hit.primitive]];
    if (material.normal_map == no_index) return x.normal;
    const Tangent tangent = tangent_of(scene_, hit.primitive);
    if (tangent.direction.isZero()) return x.normal;
    const Vec3 mapped = scene_.normal_maps[material.normal_map].sample(texture_coordinates(hit));
    return mapped_normal(mapped, tangent, x.normal, geometric_normal(hit), hit.back_side);
}

Vec2 Surface::texture_coordinates(const Hit& hit) const {
    const Triangle& t = scene_.texture_indices[hit.primitive];
    return (1.0f - hit.u - hit.v) * scene_.texture_coordinates[t[0]]
           + hit.u * scene_.texture_coordinates[t[1]] + hit.v * scene_.texture_coordinates[t[2]];
}

} // namespace afterglow
