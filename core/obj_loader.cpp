#include "core/obj_loader.h"

#include "core/error.h"
#include "core/file.h"
#include "core/mtl_text.h"
#include "core/obj_lines.h"
#include "core/polygon.h"
#include "core/text.h"
#include "core/texture_file.h"

#include <Eigen/Geometry>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compare>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <istream>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <sstream>
#include <string_view>
#include <unordered_map>
#include <utility>

namespace afterglow {
namespace {

namespace fs = std::filesystem;

constexpr float largest_reflectance = 0.999f; // at one, light would bounce forever
constexpr std::size_t most_indices = 999'999'999;

// ---- Materials and textures
// -------------------------------------------------------------------------

struct MaterialSource {
    Material material;
    std::string texture_file; // path, empty where there is none
    NormalSource normals;
    Vec2 uv_scale = Vec2::Ones(), uv_offset = Vec2::Zero(); // of texture coordinates
    bool moves_texture() const { return uv_scale != Vec2::Ones() || uv_offset != Vec2::Zero(); }
};

/// Names in OBJ and MTL files may be written on another system.
fs::path beside(const fs::path& folder, std::string_view name) {
    std::string portable(trimmed(name));
    std::replace(portable.begin(), portable.end(), '\\', '/');
    return folder / portable.c_str(); // a name ends at a zero, for the operating system as well
}

/// Notes a file that was read where it is not the user's folder, or one below it, that it came from.
/// Symbolic links are followed: a link may lead anywhere.
void note_if_outside(const std::string& file, const fs::path& folder, SceneSummary& summary) {
    std::error_code failed;
    const fs::path real_folder = fs::weakly_canonical(folder.empty() ? "." : folder, failed);
    const fs::path real_file = failed ? fs::path() : fs::weakly_canonical(file, failed);
    const bool inside =
        !failed
        && std::mismatch(real_folder.begin(), real_folder.end(), real_file.begin(), real_file.end())
                   .first
               == real_folder.end();
    auto& known = summary.outside_files;
    if (!inside && std::find(known.begin(), known.end(), file) == known.end()) known.push_back(file);
}

bool is_file(const fs::path& path) {
    std::error_code ignored;
    return fs::is_regular_file(path, ignored);
}

/// Reads the MTL files that the OBJ file names.
class MaterialFiles : public tinyobj::MaterialReader {
public:
    MaterialFiles(fs::path folder, const ObjLines& obj, SceneSummary& summary)
        : folder_(std::move(folder)), obj_(obj), summary_(summary) {}

    bool operator()(const std::string& name, std::vector<tinyobj::material_t>* materials,
                    std::map<std::string, int>* index, std::string* warnings,
                    std::string* errors) override {
        // tinyobjloader splits the line at spaces; most often it is one name that contains them.
        std::string_view line = trimmed(obj_.line());
        line.remove_prefix(std::min(line.size(), std::strlen("mtllib")));
        const fs::path whole = beside(folder_, line), part = beside(folder_, name);
        const fs::path& path = is_file(whole) ? whole : part;

        if (!asked_.insert(path).second) return false; // it was read, or told of, before
        std::ifstream file(path);
        if (!is_file(path) || !file) {
            summary_.missing_files.push_back(path.string());
            return false;
        }
        note_if_outside(path.string(), folder_, summary_);
        const std::size_t known = materials->size();
        const std::string read_text{std::istreambuf_iterator<char>(file), {}};
        std::istringstream text(mtl_for_tinyobj(read_text));
        tinyobj::LoadMtl(index, materials, &text, warnings, errors);
        for (std::size_t i = known; i < materials->size(); ++i) {
            tinyobj::material_t& read = (*materials)[i];
            std::replace(read.name.begin(), read.name.end(), mtl_blank_in_name, ' ');
            index->emplace(read.name, static_cast<int>(i));
            sources.push_back(convert(read, path.parent_path()));
        }
        return false; // what "mtllib a.mtl b.mtl" names next is read as well
    }

    std::vector<MaterialSource> sources; // in tinyobjloader's order

private:
    static MaterialSource convert(const tinyobj::material_t& from, const fs::path& folder) {
        MaterialSource source;
        source.material.name = trimmed(from.name);
        source.material.reflectance = Rgb(from.diffuse[0], from.diffuse[1], from.diffuse[2]);
        if (!trimmed(from.diffuse_texname).empty())
            source.texture_file = beside(folder, from.diffuse_texname).string();
        if (!trimmed(from.normal_texname).empty()) {
            source.normals = {beside(folder, from.normal_texname).string(), false, 1.0f};
        } else if (!trimmed(from.bump_texname).empty()) {
            const float given = from.bump_texopt.bump_multiplier;
            const float multiplier = std::isfinite(given) ? std::clamp(given, -1e6f, 1e6f) : 1.0f;
            source.normals = {beside(folder, from.bump_texname).string(), true, multiplier};
        }
        const tinyobj::texture_option_t& options = !source.texture_file.empty() ? from.diffuse_texopt
                                                   : source.normals.may_be_heights ? from.bump_texopt
                                                                                 : from.normal_texopt;
        source.uv_scale = {options.scale[0], options.scale[1]};
        source.uv_offset = {options.origin_offset[0], options.origin_offset[1]};
        return source;
    }

    fs::path folder_;
    const ObjLines& obj_;
    SceneSummary& summary_;
    std::set<fs::path> asked_;
};

// ---- Faces
// ------------------------------------------------------------------------------------------

/// One corner of a face: indices from zero, no_index where absent, bad_index where impossible.
struct Corner {
    std::uint32_t position, texture, normal;
};
constexpr std::uint32_t bad_index = no_index - 1;

struct Face {
    std::uint32_t corners;
    int material; // of MaterialFiles::sources, -1 for none
};

/// What the file says, before anything is checked against anything.
struct RawObj {
    std::vector<Vec3> positions, normals;
    std::vector<Vec2> texture_coordinates;
    std::vector<Corner> corners; // of all faces in turn
    std::vector<Face> faces;
    std::vector<MaterialSource> materials;
};

/// Collects tinyobjloader's calls into a RawObj.
struct Collector {
    RawObj& raw;
    const std::string& path;
    const std::vector<MaterialSource>& sources;
    int material = -1;
    std::unordered_map<std::string, int> trimmed_names = {}; // of the first `named` sources
    std::size_t named = 0;

    void check_count(std::size_t count) const {
        if (count >= most_indices)
            throw FileError(path, "has more than " + std::to_string(most_indices)
                                      + " vertices or corners; split it");
    }
    /// OBJ counts from 1, backwards from the last element below zero, and 0 is no index.
    static std::uint32_t resolve(int index, std::size_t count) {
        if (index > 0) return static_cast<std::uint32_t>(index - 1);
        if (index == 0) return no_index;
        const std::int64_t from_end = static_cast<std::int64_t>(count) + index;
        return from_end >= 0 ? static_cast<std::uint32_t>(from_end) : bad_index;
    }
    void add_face(const tinyobj::index_t* index, int count) {
        check_count(raw.corners.size() + static_cast<std::size_t>(count));
        for (int i = 0; i < count; ++i)
            raw.corners.push_back({resolve(index[i].vertex_index, raw.positions.size()),
                                   resolve(index[i].texcoord_index, raw.texture_coordinates.size()),
                                   resolve(index[i].normal_index, raw.normals.size())});
        raw.faces.push_back({static_cast<std::uint32_t>(count), material});
    }
    /// tinyobjloader compares whole lines with whole lines: blanks at the end of one hide the
    /// other.
    void use_material(std::string_view name, int id) {
        material = id;
        if (material >= 0) return;
        for (; named < sources.size(); ++named)
            trimmed_names.emplace(sources[named].material.name, static_cast<int>(named));
        if (const auto found = trimmed_names.find(std::string(trimmed(name))); found != trimmed_names.end())
            material = found->second;
    }
};

tinyobj::callback_t callbacks() {
    tinyobj::callback_t to;
    to.vertex_cb = [](void* user, float x, float y, float z, float) {
        auto& c = *static_cast<Collector*>(user);
        c.check_count(c.raw.positions.size());
        c.raw.positions.emplace_back(x, y, z);
    };
    to.normal_cb = [](void* user, float x, float y, float z) {
        static_cast<Collector*>(user)->raw.normals.emplace_back(x, y, z);
    };
    to.texcoord_cb = [](void* user, float x, float y, float) {
        static_cast<Collector*>(user)->raw.texture_coordinates.emplace_back(x, y);
    };
    to.index_cb = [](void* user, tinyobj::index_t* index, int count) {
        static_cast<Collector*>(user)->add_face(index, count);
    };
    to.usemtl_cb = [](void* user, const char* name, int id) {
        static_cast<Collector*>(user)->use_material(name, id);
    };
    return to;
}

RawObj parse(const std::string& path, SceneSummary& summary) {
    const MappedFile file(path);
    ObjLines lines({reinterpret_cast<const char*>(file.bytes().data()), file.bytes().size()});
    std::istream stream(&lines);
    stream.exceptions(std::ios::badbit); // errors of our own calls come through
    MaterialFiles material_files(fs::path(path).parent_path(), lines, summary);

    RawObj raw;
    Collector collector{raw, path, material_files.sources};
    tinyobj::LoadObjWithCallback(stream, callbacks(), &collector, &material_files);
    raw.materials = std::move(material_files.sources);
    return raw;
}

// ---- From faces to a scene
// --------------------------------------------------------------------------

/// Neither a line nor a point, as seen from its own size, and with a normal that fits a float.
bool has_area(const Vec3& a, const Vec3& b, const Vec3& c) {
    const Eigen::Vector3d ab = (b - a).cast<double>(), ac = (c - a).cast<double>();
    const double twice_area = ab.cross(ac).norm();
    const double longest = std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()});
    return twice_area > 2e-12 * longest && twice_area > 1e-36;
}

class SceneMaker {
public:
    SceneMaker(RawObj& raw, Scene& scene) : raw_(raw), scene_(scene) {
        new_material_.assign(raw.materials.size() + 1, no_index);
        normalise_normals();
    }

    void add_faces() {
        scene_.summary.faces = raw_.faces.size();
        std::size_t triangles = 0;
        for (const Face& face : raw_.faces)
            triangles += std::max(face.corners, 2u) - 2;
        scene_.triangles.reserve(triangles);
        scene_.material_index.reserve(triangles);
        if (!raw_.normals.empty()) scene_.normal_indices.reserve(triangles);
        if (!raw_.texture_coordinates.empty()) scene_.texture_indices.reserve(triangles);

        const Corner* corner = raw_.corners.data();
        for (const Face& face : raw_.faces) {
            add_face({corner, face.corners}, face.material);
            corner += face.corners;
        }
        scene_.summary.triangles = scene_.triangles.size();
    }

    /// Keeps only the vertices that a triangle uses: a stray one would stretch the bounds.
    void take_vertices() {
        std::vector<std::uint32_t> renamed(raw_.positions.size(), no_index);
        for (Triangle& triangle : scene_.triangles)
            for (std::uint32_t& index : triangle)
                renamed[index] = 0;
        std::uint32_t count = 0;
        for (std::size_t i = 0; i < renamed.size(); ++i) {
            if (renamed[i] == no_index) continue;
            renamed[i] = count;
            raw_.positions[count++] = raw_.positions[i];
        }
        raw_.positions.resize(count);
        for (Triangle& triangle : scene_.triangles)
            for (std::uint32_t& index : triangle)
                index = renamed[index];
        scene_.positions = std::move(raw_.positions);
        scene_.normals = std::move(raw_.normals);
        scene_.texture_coordinates = std::move(raw_.texture_coordinates);
    }

private:
    void normalise_normals() {
        normal_usable_.resize(raw_.normals.size());
        for (std::size_t i = 0; i < raw_.normals.size(); ++i) {
            const Vec3 unit = raw_.normals[i].stableNormalized();
            normal_usable_[i] = std::abs(unit.norm() - 1.0f) < 1e-3f; // false for zero and NaN
            raw_.normals[i] = normal_usable_[i] ? unit : Vec3(Vec3::UnitY());
        }
        for (Vec2& uv : raw_.texture_coordinates) {
            texture_usable_.push_back(is_reachable(uv));
            if (!texture_usable_.back()) uv.setZero();
        }
    }

    void add_face(std::span<const Corner> corner, int material) {
        SceneSummary& summary = scene_.summary;
        if (corner.size() < 3) {
            ++summary.dropped_degenerate;
            return;
        }
        polygon_.clear();
        for (const Corner& c : corner) {
            if (c.position >= raw_.positions.size()) {
                summary.dropped_bad_index += corner.size() - 2;
                return;
            }
            polygon_.push_back(raw_.positions[c.position]);
        }
        if (!std::all_of(polygon_.begin(), polygon_.end(), is_reachable)) {
            summary.dropped_not_finite += corner.size() - 2;
            return;
        }
        cuts_.clear();
        triangulate(polygon_, cuts_);
        for (const auto& cut : cuts_) {
            if (has_area(polygon_[cut[0]], polygon_[cut[1]], polygon_[cut[2]]))
                add_triangle({corner[cut[0]], corner[cut[1]], corner[cut[2]]}, material);
            else
                ++summary.dropped_degenerate;
        }
    }

    void add_triangle(std::array<Corner, 3> c, int material) {
        // Normals, where there are any, say which side is which: what was mirrored has them the other way round.
        if (is_wound_against_normals(c)) std::swap(c[1], c[2]);
        scene_.triangles.push_back({c[0].position, c[1].position, c[2].position});
        scene_.material_index.push_back(material_of(material));
        if (!raw_.normals.empty()) {
            const Triangle n{c[0].normal, c[1].normal, c[2].normal};
            for (const std::uint32_t i : n)
                scene_.summary.replaced_normals += is_bad(i, normal_usable_);
            scene_.normal_indices.push_back(complete(n, normal_usable_));
        }
        if (!raw_.texture_coordinates.empty())
            scene_.texture_indices.push_back(
                moved(complete({c[0].texture, c[1].texture, c[2].texture}, texture_usable_), material));
    }

    bool is_wound_against_normals(const std::array<Corner, 3>& c) const {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Corner& corner : c) {
            if (corner.normal == no_index || is_bad(corner.normal, normal_usable_)) return false;
            sum += raw_.normals[corner.normal].template cast<double>();
        }
        const auto position = [&](int k) -> Eigen::Vector3d {
            return raw_.positions[c[static_cast<std::size_t>(k)].position].template cast<double>();
        };
        return sum.dot((position(1) - position(0)).cross(position(2) - position(0))) < 0.0;
    }

    /// Texture coordinates as a material scales and shifts them (-s, -o), which are new ones.
    Triangle moved(const Triangle& t, int material) {
        if (t[0] == no_index || material < 0 || !raw_.materials[static_cast<std::size_t>(material)].moves_texture())
            return t;
        const MaterialSource& source = raw_.materials[static_cast<std::size_t>(material)];
        Triangle result;
        for (std::size_t k = 0; k < 3; ++k) {
            const auto [entry, is_new] = moved_.try_emplace({t[k], material}, no_index);
            if (is_new) {
                const Vec2 uv = source.uv_scale.cwiseProduct(raw_.texture_coordinates[t[k]]) + source.uv_offset;
                if (is_reachable(uv)) {
                    entry->second = static_cast<std::uint32_t>(raw_.texture_coordinates.size());
                    raw_.texture_coordinates.push_back(uv);
                }
            }
            result[k] = entry->second;
        }
        const bool whole = std::ranges::find(result, no_index) == result.end();
        return whole ? result : Triangle{no_index, no_index, no_index};
    }

    static bool is_bad(std::uint32_t index, const std::vector<bool>& is_usable) {
        return index != no_index && (index >= is_usable.size() || !is_usable[index]);
    }
    static Triangle complete(const Triangle& t, const std::vector<bool>& is_usable) {
        const bool whole = std::all_of(t.begin(), t.end(), [&](std::uint32_t i) {
            return i != no_index && !is_bad(i, is_usable);
        });
        return whole ? t : Triangle{no_index, no_index, no_index};
    }

    /// Index in scene_.materials, which holds only what is used; the last place of new_material_ is
    /// the material of faces that have none.
    std::uint32_t material_of(int material) {
        const bool known = material >= 0;
        scene_.summary.default_material += !known;
        std::uint32_t& index =
            new_material_[known ? static_cast<std::size_t>(material) : raw_.materials.size()];
        if (index == no_index) {
            index = static_cast<std::uint32_t>(scene_.materials.size());
            scene_.materials.push_back(
                known ? checked(raw_.materials[static_cast<std::size_t>(material)])
                      : Material{"default", Rgb::Constant(0.5f), no_index});
        }
        return index;
    }

    Material checked(const MaterialSource& source) {
        Material material = source.material;
        bool clamped = false;
        for (float& value : material.reflectance) {
            const float given = value;
            value = given > 0.0f ? std::min(given, largest_reflectance) : 0.0f; // NaN as well
            clamped = clamped || value != given;
        }
        scene_.summary.clamped_reflectance += clamped;
        if (!source.texture_file.empty())
            material.texture = index_of(source.texture_file, source.texture_file, texture_by_file_,
                                        scene_.textures, [&] { return read_texture(source.texture_file); });
        if (!source.normals.file.empty())
            material.normal_map = index_of(source.normals, source.normals.file, normal_map_by_source_,
                                           scene_.normal_maps, [&] { return read_normal_map(source.normals); });
        return material;
    }

    /// Index in `pictures`, where it is read into when it is first asked for; no_index where it cannot
    /// be read.
    template <class Source, class Read>
    std::uint32_t index_of(const Source& source, const std::string& file,
                           std::map<Source, std::uint32_t>& known, std::vector<Texture>& pictures,
                           const Read& read) {
        const auto [entry, is_new] = known.try_emplace(source, no_index);
        if (is_new) {
            try {
                pictures.push_back(read());
                note_if_outside(file, fs::path(scene_.name).parent_path(), scene_.summary);
                entry->second = static_cast<std::uint32_t>(pictures.size() - 1);
            } catch (const FileError&) {
                scene_.summary.missing_files.push_back(file);
            }
        }
        return entry->second;
    }

    RawObj& raw_;
    Scene& scene_;
    std::vector<bool> normal_usable_, texture_usable_;
    std::vector<std::uint32_t> new_material_;
    std::map<std::pair<std::uint32_t, int>, std::uint32_t> moved_; // texture coordinate and material
    std::map<std::string, std::uint32_t> texture_by_file_;
    std::map<NormalSource, std::uint32_t> normal_map_by_source_;
    std::vector<Vec3> polygon_;
    std::vector<std::array<std::uint32_t, 3>> cuts_;
};

} // namespace

Scene load_obj(const std::string& path) {
    Scene scene;
    scene.name = path;
    RawObj raw = parse(path, scene.summary);
    SceneMaker maker(raw, scene);
    maker.add_faces();
    if (scene.triangles.empty())
        throw FileError(path, raw.faces.empty()
                                  ? "holds no faces; a Wavefront OBJ file is needed"
                                  : "holds no usable triangle (" + scene.summary.line() + ")");
    maker.take_vertices();
    return scene;
}

} // namespace afterglow
