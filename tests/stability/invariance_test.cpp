#include "tests/stability/scenes_light.h"
#include "tests/stability/seeds.h"
#include "tests/support/surface_samples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

namespace afterglow {
namespace {

Setting room() {
    Setting setting{make_room(), room_lights(), {}};
    const Surface surface(setting.scene);
    setting.places = points_in_sight(surface, eye_in_room, 400, 5);
    return setting;
}

Setting room_as(const Scene& scene) {
    Setting setting = room();
    setting.scene = scene;
    return setting;
}

TEST(Invariance, PowersOfTwoOfTheUnitOfLengthGiveTheSameBits) {
    const Setting setting = room();
    PrecomputeOptions wide; // as good for this, and soon done
    wide.coarse_scale = 2.0f;
    const OfSeeds metres = indirect_of_seeds(setting, 1, 1, wide);
    for (const float factor : {0x1p-10f, 0x1p17f}) {
        const OfSeeds other = indirect_of_seeds(scaled(setting, factor), 1, 1, wide);
        EXPECT_TRUE((other[0] == metres[0]).all()) << factor;
    }
}

// Two results differ by less than twice the standard error that their seeds alone would make.
// Versions are combined, as each takes an operator of its own; afterglow_stability looks at them
// one by one, and at a scene that is wound the other way as a whole, of which this does not hold.
TEST(Invariance, TheSameSurfacesOtherwiseDescribedGiveTheSameLight) {
    constexpr double most_errors = 2.0;
    const Scene scene = make_room();
    const Setting small_unit = scaled(
        room_as(with_flat_normals(
            with_coplanar_faces(duplicated(with_other_diagonals(scene), 1.0f), 1.0f), 1.0f, 0.5f)),
        1e-3f);
    const Setting large_unit =
        scaled(room_as(with_flat_normals(
                   split_in_four(make_room({.overhang = 0.5f, .sunken = 0.2f})), -1.0f, 1.0f)),
               1e5f);
    const Setting far_millimetres =
        shifted(scaled(room_as(flipped(with_t_junctions(scene, 0.5f), 0.5f)), 1e3f),
                Vec3(1e6f, -1e6f, 1e6f));

    const OfSeeds base = indirect_of_seeds(room(), 1, 3);
    for (const auto& [name, setting] : {
             std::pair<std::string, Setting>{
                 "x 1e-3, other diagonals, faces duplicated and coplanar, half the normals",
                 small_unit},
             {"x 1e5, cut in four, walls and furniture cross, normals the wrong way", large_unit},
             {"millimetres shifted by 1e6, T-junctions, flipped at random", far_millimetres},
         }) {
        const Difference d = difference(base, indirect_of_seeds(setting, 1, 1));
        EXPECT_LE(d.in_errors(), most_errors)
            << name << ": difference " << d.size << ", standard error " << d.standard_error;
        // What the seeds make of single places averages out over hundreds: an offset of all does not.
        EXPECT_LE(std::abs(d.bias), 0.5 * d.standard_error) << name;
    }
}

} // namespace
} // namespace afterglow
