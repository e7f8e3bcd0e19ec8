#include "core/image.h"
#include "core/obj_loader.h"
#include "tests/fuzz/harness.h"

#include <algorithm>
#include <vector>

// A scene of two files: the OBJ, and behind a line "# scene.mtl" its materials. They lie in a folder
// together with picture.png.

using namespace afterglow;

namespace {

constexpr std::string_view materials_follow = "# scene.mtl\n";

bool are_below(const std::vector<Triangle>& triangles, std::size_t count, bool may_be_missing) {
    return std::all_of(triangles.begin(), triangles.end(), [&](const Triangle& t) {
        return std::all_of(t.begin(), t.end(), [&](std::uint32_t i) {
            return i < count || (may_be_missing && i == no_index);
        });
    });
}

void require_sound(const Scene& scene) {
    const std::size_t triangles = scene.triangles.size();
    require(triangles > 0 && scene.material_index.size() == triangles, "a material each");
    require(are_below(scene.triangles, scene.positions.size(), false), "vertices are there");
    require(are_below(scene.normal_indices, scene.normals.size(), true), "normals are there");
    require(are_below(scene.texture_indices, scene.texture_coordinates.size(), true),
            "texture coordinates are there");
    for (const std::vector<Triangle>* list : {&scene.normal_indices, &scene.texture_indices})
        require(list->empty() || list->size() == triangles, "an entry for each triangle, or none");
    for (const std::uint32_t m : scene.material_index)
        require(m < scene.materials.size(), "materials are there");
    for (const Vec3& p : scene.positions)
        require(p.allFinite(), "positions are finite");
    for (const Vec3& n : scene.normals)
        require(std::abs(n.norm() - 1.0f) < 1e-3f, "normals are of unit length");
    for (const Material& m : scene.materials) {
        require((m.reflectance >= 0.0f).all() && (m.reflectance < 1.0f).all(), "reflectance in [0, 1)");
        require(m.texture == no_index || m.texture < scene.textures.size(), "textures are there");
        require(m.normal_map == no_index || m.normal_map < scene.normal_maps.size(),
                "normal maps are there");
    }
    for (const unsigned char c : scene.summary.line())
        require(c >= 32 && c != 127, "the summary is one line without control characters");
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const TemporaryFolder& folder = input_folder();
    static const bool picture_is_there = [&] {
        write_png_bytes(folder.path("picture.png"), 2, 2,
                        std::vector<unsigned char>{255, 255, 255, 0, 0, 0, 255, 0, 0, 128, 128, 255});
        return true;
    }();
    require(picture_is_there, "a picture for the materials");
    const std::string text = text_of(data, size);
    const std::size_t cut = std::min(text.find(materials_follow), text.size());
    folder.write("scene.obj", text.substr(0, cut));
    folder.write("scene.mtl", text.substr(cut));
    accept_refusal([&] { require_sound(load_obj(folder.path("scene.obj"))); });
    return 0;
}
