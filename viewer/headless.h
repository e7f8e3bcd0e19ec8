#pragma once

#include "viewer/composition.h"
#include "viewer/renderer.h"

#include <string>

namespace afterglow {

struct HeadlessOptions {
    std::string frames;  // path of a frame path, see read_frame_path()
    std::string folder;  // where pictures go, made where it is not there
    std::string format = "png"; // or "exr"
    std::string context = "auto"; // see make_offscreen_context()
    IndirectMethod method = IndirectMethod::automatic;
    ViewLayer layer = ViewLayer::full;
    int width = 1280, height = 720;
    int samples = 4;         // a pixel, as of `afterglow render`
    float exposure = 0.18f;  // key of the tone map, for PNG
    double seconds = 0.0;    // the path is drawn over and over until so many have passed
};

/// Draws every frame of a path without a window: frame_0000.png and so on, and timings.json with the
/// milliseconds of each stage of each frame, of the last time round where there are several; each replaces
/// the pictures of the one before. Throws FileError, UsageError; Error where OpenGL failed.
void draw_frames(const TransferScene& scene, const HeadlessOptions& options);

} // namespace afterglow
