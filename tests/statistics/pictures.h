#pragma once

#include "core/camera.h"
#include "core/scene.h"
#include "tests/support/statistics.h"
#include "transport/path_tracer.h"
#include "transport/spotlight.h"

#include <ostream>
#include <string>
#include <vector>

namespace afterglow {

/// A scene under a spotlight, seen by a camera that sees nothing else.
struct PictureSetting {
    std::string name; // without "builtin:"
    Camera camera;
    Spotlight light;

    Scene scene() const;
};

/// How a failed test names it.
inline void PrintTo(const PictureSetting& setting, std::ostream* out) {
    *out << setting.name;
}

/// builtin:cornell and builtin:two_rooms.
const std::vector<PictureSetting>& picture_settings();

/// The layers of which references are stored.
inline constexpr Layer stored_layers[] = {Layer::indirect, Layer::full};

/// How the stored references were made, by plain path tracing.
inline const PathTracerOptions reference_options{
    .samples = 1 << 16, .batches = 64, .seed = 0xafe};

/// Where the references lie. The variance is that of the mean.
std::string mean_file(const std::string& folder, const PictureSetting& setting, Layer layer);
std::string variance_file(const std::string& folder, const PictureSetting& setting, Layer layer);

/// Of one picture, the means over squares of so many pixels, colour by colour, each with its variance:
/// pixels are estimated independently of each other. A square as large as the picture or larger: all.
std::vector<KnownMean> square_means(const Image& mean, const Image& variance, int batches, int square);

} // namespace afterglow
