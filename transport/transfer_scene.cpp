#include "transport/transfer_scene.h"

#include <cstdio>

namespace afterglow {

void tell_of_outside_files(const Scene& scene) {
    if (const std::string line = scene.summary.outside_line(); !line.empty())
        std::fprintf(stderr, "%s: %s\n", scene.name.c_str(), line.c_str());
}

} // namespace afterglow
