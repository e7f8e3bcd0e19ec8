#include "core/obj_loader.h"
#include "tests/fuzz/harness.h"

// A picture, in whatever format, that a scene uses as texture and as normal map.

using namespace afterglow;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const TemporaryFolder& folder = input_folder();
    static const std::string scene_file =
        (folder.write("scene.mtl", "newmtl a\nmap_Kd picture\nmap_Bump picture\n"),
         folder.write("scene.obj",
                      "mtllib scene.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"));
    folder.write("picture", text_of(data, size));
    accept_refusal([&] {
        const Scene scene = load_obj(scene_file);
        require(scene.textures.size() == scene.normal_maps.size(), "a picture is readable or it is not");
        for (const Texture& t : scene.textures) {
            require(t.width > 0 && t.height > 0, "a texture is not empty");
            require(t.rgb.size() == 3u * static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height),
                    "three numbers a texel");
            require((t.sample({0.3f, -7.9f}) >= 0.0f).all(), "a texture can be looked up anywhere");
        }
    });
    return 0;
}
