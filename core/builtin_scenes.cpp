#include "core/builtin_scenes.h"

#include "core/error.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <charconv>
#include <map>
#include <string_view>

namespace afterglow {
namespace {

constexpr std::string_view prefix = "builtin:";

/// Collects triangles; equal positions become one vertex.
class MeshBuilder {
public:
    std::uint32_t material(const std::string& name, const Rgb& reflectance) {
        scene_.materials.push_back({name, reflectance, no_index});
        return static_cast<std::uint32_t>(scene_.materials.size() - 1);
    }
    void triangle(const Vec3& a, const Vec3& b, const Vec3& c, std::uint32_t material) {
        scene_.triangles.push_back({vertex(a), vertex(b), vertex(c)});
        scene_.material_index.push_back(material);
    }
    /// Corners counter-clockwise as seen from the open side.
    void quad(const std::array<Vec3, 4>& corner, std::uint32_t material) {
        triangle(corner[0], corner[1], corner[2], material);
        triangle(corner[0], corner[2], corner[3], material);
        ++quads_;
    }
    Scene finish(const Vec3& viewpoint) {
        scene_.viewpoint = viewpoint;
        scene_.summary.triangles = scene_.triangles.size();
        scene_.summary.faces = scene_.triangles.size() - quads_;
        return std::move(scene_);
    }

private:
    std::uint32_t vertex(const Vec3& p) {
        const auto next = static_cast<std::uint32_t>(scene_.positions.size());
        const auto [place, is_new] = index_.try_emplace({p.x(), p.y(), p.z()}, next);
        if (is_new) scene_.positions.push_back(p);
        return place->second;
    }

    Scene scene_;
    std::map<std::array<float, 3>, std::uint32_t> index_;
    std::size_t quads_ = 0;
};

/// "Cornell Box Data", Cornell University Program of Computer Graphics: all quads in millimetres,
/// in the order and winding of the data, whose fronts face the air.
Scene make_cornell() {
    // Linear Rec. 709 from the measured spectra (400 to 700 nm by 4 nm): for each wall the integral
    // of reflectance x D65 x the CIE 1931 colour matching functions (the fits of Wyman, Sloan and
    // Shirley 2013) over 400 ... 700 nm in steps of 1 nm, taken to Rec. 709 and divided by what a
    // reflectance of one gives, so that a perfect white is (1, 1, 1).
    MeshBuilder mesh;
    const auto white = mesh.material("white", {0.7382f, 0.7358f, 0.7401f});
    const auto red = mesh.material("red", {0.4901f, 0.0504f, 0.0510f});
    const auto green = mesh.material("green", {0.0686f, 0.3982f, 0.0866f});
    struct Face {
        std::uint32_t material;
        float corner[4][3];
    };
    const Face faces[] = {
        // floor, ceiling, back wall
        {white, {{552.8f, 0, 0}, {0, 0, 0}, {0, 0, 559.2f}, {549.6f, 0, 559.2f}}},
        {white, {{556, 548.8f, 0}, {556, 548.8f, 559.2f}, {0, 548.8f, 559.2f}, {0, 548.8f, 0}}},
        {white, {{549.6f, 0, 559.2f}, {0, 0, 559.2f}, {0, 548.8f, 559.2f}, {556, 548.8f, 559.2f}}},
        // right and left wall, as the camera sees them
        {green, {{0, 0, 559.2f}, {0, 0, 0}, {0, 548.8f, 0}, {0, 548.8f, 559.2f}}},
        {red, {{552.8f, 0, 0}, {549.6f, 0, 559.2f}, {556, 548.8f, 559.2f}, {556, 548.8f, 0}}},
        // short block
        {white, {{130, 165, 65}, {82, 165, 225}, {240, 165, 272}, {290, 165, 114}}},
        {white, {{290, 0, 114}, {290, 165, 114}, {240, 165, 272}, {240, 0, 272}}},
        {white, {{130, 0, 65}, {130, 165, 65}, {290, 165, 114}, {290, 0, 114}}},
        {white, {{82, 0, 225}, {82, 165, 225}, {130, 165, 65}, {130, 0, 65}}},
        {white, {{240, 0, 272}, {240, 165, 272}, {82, 165, 225}, {82, 0, 225}}},
        // tall block
        {white, {{423, 330, 247}, {265, 330, 296}, {314, 330, 456}, {472, 330, 406}}},
        {white, {{423, 0, 247}, {423, 330, 247}, {472, 330, 406}, {472, 0, 406}}},
        {white, {{472, 0, 406}, {472, 330, 406}, {314, 330, 456}, {314, 0, 456}}},
        {white, {{314, 0, 456}, {314, 330, 456}, {265, 330, 296}, {265, 0, 296}}},
        {white, {{265, 0, 296}, {265, 330, 296}, {423, 330, 247}, {423, 0, 247}}},
    };
    for (const Face& face : faces) {
        std::array<Vec3, 4> corner;
        for (int k = 0; k < 4; ++k)
            corner[k] = 0.001f * Vec3::Map(face.corner[k]);
        mesh.quad(corner, face.material);
    }
    return mesh.finish({0.278f, 0.273f, 0.03f});
}

/// A grid of cells along the axes, some of them filled with air. Every cell face between air and
/// solid becomes a quad that is seen from the air, so that the mesh is closed without T-junctions.
struct AirGrid {
    std::vector<float> x, y, z; // cell borders, increasing

    template <class IsAir, class MaterialOf>
    void add_to(MeshBuilder& mesh, const IsAir& is_air, const MaterialOf& material_of) const {
        const std::array<const std::vector<float>*, 3> border{&x, &y, &z};
        const std::array<int, 3> cells{static_cast<int>(x.size()) - 1,
                                       static_cast<int>(y.size()) - 1,
                                       static_cast<int>(z.size()) - 1};
        const auto air = [&](const std::array<int, 3>& c) {
            for (int axis = 0; axis < 3; ++axis)
                if (c[axis] < 0 || c[axis] >= cells[axis]) return false;
            return is_air(c[0], c[1], c[2]);
        };
        std::array<int, 3> c{};
        for (c[0] = 0; c[0] < cells[0]; ++c[0])
            for (c[1] = 0; c[1] < cells[1]; ++c[1])
                for (c[2] = 0; c[2] < cells[2]; ++c[2])
                    for (int face = 0; face < 6 && air(c); ++face) {
                        const int axis = face / 2, upper = face % 2;
                        std::array<int, 3> beyond = c;
                        beyond[axis] += upper ? 1 : -1;
                        if (air(beyond)) continue;
                        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
                        std::array<Vec3, 4> corner;
                        for (int k = 0; k < 4; ++k) {
                            // Around +axis counter-clockwise; the upper face is seen from below.
                            const int i = upper ? 3 - k : k;
                            corner[k][axis] = (*border[axis])[c[axis] + upper];
                            corner[k][u] = (*border[u])[c[u] + (i == 1 || i == 2)];
                            corner[k][v] = (*border[v])[c[v] + (i >= 2)];
                        }
                        mesh.quad(corner, material_of(corner));
                    }
    }
};

Scene make_furnace(float reflectance) {
    MeshBuilder mesh;
    const auto grey = mesh.material("wall", Rgb::Constant(reflectance));
    AirGrid{{-1, 1}, {-1, 1}, {-1, 1}}.add_to(
        mesh, [](int, int, int) { return true; }, [&](const auto&) { return grey; });
    return mesh.finish(Vec3::Zero());
}

Scene make_two_rooms(bool door) {
    MeshBuilder mesh;
    const auto white = mesh.material("white", Rgb::Constant(0.7f));
    const auto red = mesh.material("red", {0.6f, 0.15f, 0.1f});
    constexpr float far_end = 8.05f;
    AirGrid{{0, 4, 4.05f, far_end}, {0, 2, 2.8f}, {0, 1.55f, 2.45f, 4}}.add_to(
        mesh, [&](int i, int j, int k) { return i != 1 || (door && j == 0 && k == 1); },
        [&](const std::array<Vec3, 4>& corner) {
            const bool on_far_wall = std::all_of(corner.begin(), corner.end(),
                                                 [](const Vec3& p) { return p.x() == far_end; });
            return on_far_wall ? red : white;
        });
    return mesh.finish({2.0f, 1.4f, 2.0f});
}

/// An icosahedron whose triangles are cut into four, five times.
Scene make_sphere(float reflectance) {
    MeshBuilder mesh;
    const auto grey = mesh.material("wall", Rgb::Constant(reflectance));
    const float g = 1.6180340f; // golden ratio
    const Vec3 corner[12] = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                             {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                             {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
    const int face[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                             {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                             {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                             {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    const auto divide = [&](const auto& self, const Vec3& a, const Vec3& b, const Vec3& c,
                            int times) -> void {
        if (times == 0) return mesh.triangle(a, c, b, grey); // turned to the inside
        const Vec3 ab = (a + b).normalized(), bc = (b + c).normalized(), ca = (c + a).normalized();
        self(self, a, ab, ca, times - 1);
        self(self, ab, b, bc, times - 1);
        self(self, ca, bc, c, times - 1);
        self(self, ab, bc, ca, times - 1);
    };
    for (const auto& f : face)
        divide(divide, corner[f[0]].normalized(), corner[f[1]].normalized(),
               corner[f[2]].normalized(), 5);
    return mesh.finish(Vec3::Zero());
}

float parse_reflectance(const std::string& name, std::string_view text) {
    float value = -1.0f;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()
        || !(value >= 0.0f && value < 1.0f))
        throw UsageError(name + ": the reflectance must be a number in [0, 1)");
    return value;
}

Scene make_unnamed(const std::string& name) {
    const std::string_view kind = std::string_view(name).substr(prefix.size());
    const auto reflectance_after = [&](std::string_view start) {
        return parse_reflectance(name, kind.substr(start.size()));
    };
    if (kind == "cornell") return make_cornell();
    if (kind == "furnace") return make_furnace(0.5f);
    if (kind.starts_with("furnace:")) return make_furnace(reflectance_after("furnace:"));
    if (kind.starts_with("sphere:")) return make_sphere(reflectance_after("sphere:"));
    if (kind == "two_rooms") return make_two_rooms(true);
    if (kind == "two_rooms_closed") return make_two_rooms(false);

    std::string known;
    for (const auto& [spelling, about] : builtin_scene_names())
        known += (known.empty() ? "" : ", ") + spelling;
    throw UsageError(name + ": no such built-in scene; there are " + known);
}

} // namespace

bool is_builtin_scene(const std::string& path_or_name) {
    return path_or_name.starts_with(prefix);
}

Scene make_builtin_scene(const std::string& name) {
    Scene scene = make_unnamed(name);
    scene.name = name;
    return scene;
}

std::vector<std::pair<std::string, std::string>> builtin_scene_names() {
    return {{"builtin:cornell", "the Cornell box as measured, without its lamp"},
            {"builtin:furnace", "a closed box of side 2 that reflects 0.5 everywhere"},
            {"builtin:furnace:RHO", "the same with reflectance RHO in [0, 1)"},
            {"builtin:sphere:RHO", "a closed sphere of radius 1 with reflectance RHO in [0, 1)"},
            {"builtin:two_rooms", "two closed rooms with an open door between them"},
            {"builtin:two_rooms_closed", "the same two rooms without the door"}};
}

} // namespace afterglow
