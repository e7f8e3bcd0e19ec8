#include "tests/fuzz/harness.h"
#include "viewer/frame_path.h"

// A path of camera and light (JSON).

using namespace afterglow;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string file = input_folder().write("path.json", text_of(data, size));
    accept_refusal([&] {
        const std::vector<Frame> frames = read_frame_path(file);
        require(!frames.empty(), "a path has a frame");
        const double first = frames.front().time, last = frames.back().time;
        require(first <= last, "times do not fall");
        for (const double share : {0.0, 0.3, 1.0}) {
            const Frame frame = frame_at(frames, (1.0 - share) * first + share * last);
            require(frame.camera.position.allFinite() && frame.camera.target.allFinite(),
                    "between two frames lies a camera");
            require(frame.light.position.allFinite() && frame.light.direction.allFinite(),
                    "between two frames lies a light");
        }
    });
    return 0;
}
