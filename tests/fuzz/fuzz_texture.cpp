#include "core/texture_file.h"
#include "tests/fuzz/harness.h"

// A picture, as texture and as normal map.

using namespace afterglow;

namespace {

void require_whole(const Texture& t) {
    require(t.width > 0 && t.height > 0, "a texture is not empty");
    require(t.rgb.size() == 3u * static_cast<std::size_t>(t.width) * static_cast<std::size_t>(t.height),
            "three numbers a texel");
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string file = input_folder().write("picture", text_of(data, size));
    accept_refusal([&] {
        const Texture texture = read_texture(file);
        require_whole(texture);
        require((texture.sample({0.3f, -7.9f}) >= 0.0f).all(), "a texture can be looked up anywhere");
        require(read_texture(file).rgb == texture.rgb, "the same file gives the same picture");
        const Texture normals = read_normal_map({file, true, 1.0f});
        require_whole(normals);
        require(std::abs(Vec3::Map(normals.rgb.data()).norm() - 1.0f) < 1e-3f, "normals are of unit length");
    });
    return 0;
}
