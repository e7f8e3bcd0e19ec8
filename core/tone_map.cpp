#include "core/tone_map.h"

#include "core/parallel.h"

#include <algorithm>
#include <cmath>

namespace afterglow {
namespace {

struct Luminances {
    double sum_of_logs = 0.0;
    float largest = 0.0f;
    Index count = 0;
    Luminances& operator+=(const Luminances& more) {
        sum_of_logs += more.sum_of_logs;
        largest = std::max(largest, more.largest);
        count += more.count;
        return *this;
    }
};

} // namespace

ToneMap::ToneMap(const Image& image, float key) {
    const auto of_pixel = [&](Index i) -> Luminances {
        const float l = luminance(Rgb::Map(&image.rgb[3 * static_cast<std::size_t>(i)]));
        if (!(l > 0.0f) || !std::isfinite(l)) return {};
        return {static_cast<double>(std::log(l)), l, 1};
    };
    const auto all = parallel_sum(static_cast<Index>(image.width) * image.height, Luminances{}, of_pixel, 8192);
    if (all.count == 0) return;
    scale = static_cast<float>(key / std::exp(all.sum_of_logs / static_cast<double>(all.count)));
    white = std::max(1.0f, scale * all.largest);
}

Rgb ToneMap::operator()(const Rgb& colour) const {
    const Rgb scaled = scale * colour;
    const Rgb c = (scaled > 1e15f).select(Rgb::Constant(1e15f), scaled); // what is infinite, too, has finite products
    const float l = std::max(0.0f, luminance(c));
    return c * (1.0f + l / (white * white)) / (1.0f + l);
}

} // namespace afterglow
