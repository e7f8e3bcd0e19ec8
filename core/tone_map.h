#pragma once

#include "core/image.h"

namespace afterglow {

/// Reinhard, Stark, Shirley and Ferwerda 2002, eqs. (1), (2) and (4): luminance is scaled so that
/// its log-average becomes `key`, then compressed so that the brightest pixel becomes white. Black
/// pixels (nothing seen) stay out of the average, and a picture darker than white is not brightened
/// (white is at least 1, where eq. (4) is the identity).
struct ToneMap {
    float scale = 1.0f, white = 1.0f;

    ToneMap() = default;
    ToneMap(const Image& image, float key);
    Rgb operator()(const Rgb& c) const;
};

/// Rec. 709 luminance.
inline float luminance(const Rgb& c) { return 0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2]; }

} // namespace afterglow
