#include "tests/statistics/pictures.h"

#include "core/builtin_scenes.h"

#include <algorithm>
#include <cmath>

namespace afterglow {

Scene PictureSetting::scene() const {
    return make_builtin_scene("builtin:" + name);
}

const std::vector<PictureSetting>& picture_settings() {
    static const std::vector<PictureSetting> settings = [] {
        std::vector<PictureSetting> all{
            {"cornell",
             {.position = Vec3(0.278f, 0.273f, -0.8f),
              .target = Vec3(0.278f, 0.273f, 0.0f),
              .vertical_fov = 30.0f, // within the open front
              .width = 16,
              .height = 12},
             {.position = Vec3(0.278f, 0.4f, -0.2f),
              .direction = Vec3(0.0f, -0.2f, 1.0f),
              .inner_angle = 40.0f,
              .outer_angle = 60.0f}},
            {"two_rooms",
             {.position = Vec3(0.3f, 1.6f, 0.6f),
              .target = Vec3(4.0f, 1.1f, 2.0f),
              .vertical_fov = 60.0f,
              .width = 16,
              .height = 12},
             {.position = Vec3(1.0f, 1.8f, 2.0f),
              .direction = Vec3(1.0f, -0.3f, 0.1f),
              .inner_angle = 60.0f,
              .outer_angle = 90.0f}}};
        for (PictureSetting& setting : all) {
            setting.camera.check();
            setting.light.check();
        }
        return all;
    }();
    return settings;
}

std::string mean_file(const std::string& folder, const PictureSetting& setting, Layer layer) {
    return folder + "/" + setting.name + "_" + layer_name(layer) + "_mean.exr";
}

std::string variance_file(const std::string& folder, const PictureSetting& setting, Layer layer) {
    return folder + "/" + setting.name + "_" + layer_name(layer) + "_variance.exr";
}

std::vector<KnownMean> square_means(const Image& mean, const Image& variance, int batches, int square) {
    std::vector<KnownMean> means;
    for (int top = 0; top < mean.height; top += square)
        for (int left = 0; left < mean.width; left += square)
            for (int colour = 0; colour < 3; ++colour) {
                double sum = 0.0, variances = 0.0, squares = 0.0, count = 0.0;
                for (int y = top; y < std::min(top + square, mean.height); ++y)
                    for (int x = left; x < std::min(left + square, mean.width); ++x) {
                        const double v = variance.pixel(x, y)[colour];
                        sum += mean.pixel(x, y)[colour];
                        variances += v;
                        squares += v * v;
                        ++count;
                    }
                KnownMean known{sum / count, variances / (count * count), batches - 1.0};
                // Of a sum of variances of as many degrees each (Satterthwaite).
                if (squares > 0.0) known.degrees *= variances * variances / squares;
                means.push_back(known);
            }
    return means;
}

} // namespace afterglow
