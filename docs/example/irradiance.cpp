// Afterglow as a library: the operator of a scene, then the light at one place under a spotlight.
//
//     irradiance SCENE X Y Z
//
// SCENE is a Wavefront OBJ file or builtin:NAME. The light is at (X, Y, Z) and shines straight down;
// what is told is the irradiance where its axis meets the scene.

#include "core/error.h"
#include "core/scene.h"
#include "core/surface.h"
#include "transport/display.h"
#include "transport/precompute.h"
#include "transport/spotlight.h"

#include <cstdio>
#include <cstdlib>

namespace {

void print(const char* name, const Eigen::Array3f& value) {
    std::printf("%s %.9g,%.9g,%.9g\n", name, value[0], value[1], value[2]);
}

void run(const char* file, const afterglow::Vec3& from) {
    const afterglow::Scene scene = afterglow::load_scene(file);
    const afterglow::Surface surface(scene);

    // Once for a scene; save_transfer() of transport/transfer_file.h would keep it.
    const afterglow::TransferOperator transfer = afterglow::precompute(surface, {});

    // Once for a light.
    afterglow::Spotlight light{.position = from};
    light.check();
    const afterglow::LightTransport transport(transfer, surface);
    const afterglow::VectorIrradiance field = transport.indirect(light);

    const afterglow::Hit hit = surface.closest_hit({from, light.direction});
    if (!hit) throw afterglow::Error("there is nothing below the light");
    const afterglow::SurfacePoint place = surface.point(hit);
    bool covered = false;
    const afterglow::Display display(transfer, surface);
    print("position", place.position);
    print("normal", place.normal);
    print("direct", direct_irradiance(surface, light, place));
    print("indirect", display.irradiance(place, place.normal, field, light, covered));
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 5) {
        std::fprintf(stderr, "usage: irradiance SCENE X Y Z\n");
        return 2;
    }
    try {
        run(argv[1], {std::strtof(argv[2], nullptr), std::strtof(argv[3], nullptr), std::strtof(argv[4], nullptr)});
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "irradiance: %s\n", error.what());
        return 1;
    }
}
