#include "viewer/scene_mesh.h"

#include "core/normal_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace afterglow {
namespace {

constexpr std::uint32_t most_in_a_piece = 2048;

struct Vertex {
    std::array<float, 3> position;
    std::array<std::int16_t, 4> normal; // signed, normalised; zero where there is none
    std::array<float, 2> uv;
};

std::int16_t coded(float x) {
    return static_cast<std::int16_t>(std::lround(std::clamp(x, -1.0f, 1.0f) * 32767.0f));
}

bool has_uv(const Scene& scene, std::uint32_t t) {
    return !scene.texture_indices.empty() && scene.texture_indices[t][0] != no_index;
}

Vertex vertex(const Scene& scene, std::uint32_t t, int corner) {
    Vertex v{};
    const Vec3& x = scene.positions[scene.triangles[t][corner]];
    v.position = {x.x(), x.y(), x.z()};
    if (!scene.normal_indices.empty() && scene.normal_indices[t][0] != no_index) {
        const Vec3& n = scene.normals[scene.normal_indices[t][corner]];
        v.normal = {coded(n.x()), coded(n.y()), coded(n.z()), 0};
    }
    if (has_uv(scene, t)) {
        const Vec2& uv = scene.texture_coordinates[scene.texture_indices[t][corner]];
        v.uv = {uv.x(), uv.y()};
    }
    return v;
}

/// The texture, or means over its texels where OpenGL takes no picture of its size.
Texture fitted(const Texture& texture, int most) {
    Texture small{std::min(texture.width, most), std::min(texture.height, most), {}};
    small.rgb.reserve(3 * static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height));
    const auto start = [](int k, int of, int size) { // of what becomes texel k of so many
        return static_cast<int>(static_cast<std::int64_t>(k) * size / of);
    };
    for (int y = 0; y < small.height; ++y)
        for (int x = 0; x < small.width; ++x) {
            const int left = start(x, small.width, texture.width), right = start(x + 1, small.width, texture.width);
            const int low = start(y, small.height, texture.height), high = start(y + 1, small.height, texture.height);
            Rgb sum = Rgb::Zero();
            for (int row = low; row < high; ++row)
                for (int column = left; column < right; ++column)
                    sum += Rgb::Map(&texture.rgb[3 * (static_cast<std::size_t>(row) * texture.width + column)]);
            sum /= static_cast<float>((right - left) * (high - low));
            small.rgb.insert(small.rgb.end(), sum.data(), sum.data() + 3);
        }
    return small;
}

} // namespace

SceneMesh::SceneMesh(const Gl& gl, const Scene& scene)
    : gl_(gl), bounds_(scene.bounds()), vertices_(make_buffer(gl)),
      vertex_array_(make_vertex_array(gl)), triangles_(gl, GL_RGBA32F, 16), tangents_(gl, GL_RGBA32F, 16) {
    // By material; within one as they come, which mostly is object by object.
    order_.resize(scene.triangles.size());
    std::iota(order_.begin(), order_.end(), 0u);
    const auto kind = [&](std::uint32_t t) {
        return std::pair(scene.material_index[t], has_uv(scene, t));
    };
    std::stable_sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
        return kind(a) < kind(b);
    });

    std::vector<Vertex> vertices;
    vertices.reserve(3 * order_.size());
    std::vector<Eigen::Vector4f> normals(order_.size(), Eigen::Vector4f::Zero());
    for (std::uint32_t k = 0; k < order_.size(); ++k) {
        const std::uint32_t t = order_[k];
        if (k == 0 || kind(t) != kind(order_[k - 1]) || pieces_.back().count == most_in_a_piece) {
            const Material& material = scene.materials[scene.material_index[t]];
            pieces_.push_back({k, 0, material.reflectance,
                               has_uv(scene, t) ? material.texture : no_index,
                               has_uv(scene, t) ? material.normal_map : no_index, {}});
        }
        ++pieces_.back().count;
        for (int corner = 0; corner < 3; ++corner) {
            vertices.push_back(vertex(scene, t, corner));
            pieces_.back().box.extend(scene.positions[scene.triangles[t][corner]]);
        }
        normals[k].head<3>() = scene.triangle_normal(t);
    }
    triangles_.set(normals.data(), normals.size());
    gl.BindVertexArray(vertex_array_);
    gl.BindBuffer(GL_ARRAY_BUFFER, vertices_);
    gl.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size() * sizeof(Vertex)),
                  vertices.data(), GL_STATIC_DRAW);
    const auto attribute = [&](GLuint location, GLint size, GLenum type, GLboolean normalized,
                               std::size_t offset) {
        gl.EnableVertexAttribArray(location);
        gl.VertexAttribPointer(location, size, type, normalized, sizeof(Vertex),
                               reinterpret_cast<const void*>(offset));
    };
    attribute(0, 3, GL_FLOAT, GL_FALSE, offsetof(Vertex, position));
    attribute(1, 3, GL_SHORT, GL_TRUE, offsetof(Vertex, normal));
    attribute(2, 2, GL_FLOAT, GL_FALSE, offsetof(Vertex, uv));
    textures_ = upload(scene.textures);
    normal_maps_ = upload(scene.normal_maps);
    if (!has_normal_maps()) return;
    std::vector<Eigen::Vector4f> tangents;
    for (const std::uint32_t t : order_) {
        const Tangent tangent = tangent_of(scene, t);
        tangents.emplace_back(tangent.direction.x(), tangent.direction.y(), tangent.direction.z(), tangent.sign);
    }
    tangents_.set(tangents.data(), tangents.size());
}

std::vector<GlName> SceneMesh::upload(const std::vector<Texture>& textures) const {
    GLint most = 0;
    gl_.GetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
    std::vector<GlName> names;
    for (const Texture& whole : textures) {
        Texture small;
        const bool fits = std::max(whole.width, whole.height) <= most;
        const Texture& texture = fits ? whole : small = fitted(whole, most);
        names.push_back(make_texture(gl_, {GL_RGB16F, GL_RGB, GL_FLOAT}, texture.width,
                                         texture.height, texture.rgb.data()));
        // As Texture::sample: bilinear, repeated. Row 0 is at v = 0 in both.
        gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_REPEAT);
        gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_REPEAT);
    }
    return names;
}

float SceneMesh::farthest(const Vec3& from) const {
    return (from - bounds_.min()).cwiseAbs().cwiseMax((from - bounds_.max()).cwiseAbs()).norm();
}

void SceneMesh::draw(const GlProgram& program, const ViewTransform& view, bool shaded) const {
    std::vector<std::pair<float, const Piece*>> seen;
    for (const Piece& piece : pieces_)
        if (view.may_see(piece.box)) seen.emplace_back(piece.box.squaredExteriorDistance(view.eye), &piece);
    std::sort(seen.begin(), seen.end());

    gl_.BindVertexArray(vertex_array_);
    if (shaded) {
        program.bind("triangles", 0, GL_TEXTURE_BUFFER, triangles_.texture());
        program.set("image", 1);
        program.set("normal_map", 2);
        program.bind("tangents", 3, GL_TEXTURE_BUFFER, tangents_.texture());
    }
    for (const auto& [distance, piece] : seen) {
        if (shaded) {
            program.set("first_triangle", piece->first);
            program.set("reflectance", piece->reflectance);
            program.set("is_textured", piece->texture != no_index ? 1 : 0);
            if (piece->texture != no_index)
                program.bind("image", 1, GL_TEXTURE_2D, textures_[piece->texture]);
            program.set("has_normal_map", piece->normal_map != no_index ? 1 : 0);
            if (piece->normal_map != no_index)
                program.bind("normal_map", 2, GL_TEXTURE_2D, normal_maps_[piece->normal_map]);
        }
        gl_.DrawArrays(GL_TRIANGLES, static_cast<GLint>(3 * piece->first),
                       static_cast<GLsizei>(3 * piece->count));
    }
}

} // namespace afterglow
