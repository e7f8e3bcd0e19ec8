#include "core/error.h"
#include "core/image.h"
#include "tests/statistics/pictures.h"

#include <cstdio>
#include <exception>

// Makes the pictures that pictures_test compares with: afterglow_make_references FOLDER. To be run
// again only where a scene or the meaning of a layer has changed, and after path_tracer_test has
// compared the path tracer with closed forms.

namespace {

using namespace afterglow;

void make(const std::string& folder, const PictureSetting& setting, Layer layer) {
    const Scene scene = setting.scene();
    const Surface surface(scene);
    PictureEstimate estimate =
        render_reference(surface, setting.light, setting.camera, layer, reference_options);
    estimate.image.attributes = estimate.variance.attributes = {
        {"afterglow.version", AFTERGLOW_VERSION},
        {"afterglow.scene", scene.name},
        {"afterglow.scene_hash", scene.content_hash()},
        {"afterglow.layer", layer_name(layer)},
        {"afterglow.samples_per_pixel", std::to_string(reference_options.samples)},
        {"afterglow.batches", std::to_string(reference_options.batches)},
        {"afterglow.seed", std::to_string(reference_options.seed)}};
    write_image(mean_file(folder, setting, layer), estimate.image, PixelType::full_float);
    write_image(variance_file(folder, setting, layer), estimate.variance, PixelType::full_float);
    std::printf("%s, %s: relative standard error of a pixel %.2f %%\n", setting.name.c_str(),
                layer_name(layer).c_str(), 100.0 * estimate.relative_error);
}

} // namespace

int main(int count, char** arguments) try {
    if (count != 2) throw UsageError("usage: afterglow_make_references FOLDER");
    for (const PictureSetting& setting : picture_settings())
        for (const Layer layer : stored_layers) make(arguments[1], setting, layer);
} catch (const std::exception& e) {
    std::fprintf(stderr, "afterglow_make_references: %s\n", e.what());
    return 1;
}
