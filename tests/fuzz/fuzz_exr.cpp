#include "core/image.h"
#include "tests/fuzz/harness.h"

// An OpenEXR file.

using namespace afterglow;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string file = input_folder().write("picture.exr", text_of(data, size));
    accept_refusal([&] {
        const Image image = read_exr(file);
        require(image.width > 0 && image.height > 0, "a picture is not empty");
        require(image.rgb.size()
                    == 3u * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height),
                "three numbers a pixel");
    });
    return 0;
}
