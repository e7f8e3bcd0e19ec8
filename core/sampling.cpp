#include "core/sampling.h"

#include <algorithm>

namespace afterglow {
namespace {

std::uint32_t reverse_bits(std::uint32_t x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
    x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
    return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

Vec3 from_polar(float cos_theta, float phi) {
    const float sin_theta = std::sqrt(std::max(0.0f, 1.0f - cos_theta * cos_theta));
    return {sin_theta * std::cos(phi), sin_theta * std::sin(phi), cos_theta};
}

constexpr float two_pi = static_cast<float>(2.0 * EIGEN_PI);

} // namespace

std::array<std::uint32_t, 2> sobol2(std::uint32_t index) {
    // The direction numbers of the second dimension are the rows of Pascal's triangle modulo 2:
    // v_1 = 1/2, v_{k+1} = v_k ^ (v_k >> 1).
    std::uint32_t second = 0;
    for (std::uint32_t v = 0x80000000u, i = index; i != 0; i >>= 1, v ^= v >> 1)
        if (i & 1u) second ^= v;
    return {reverse_bits(index), second};
}

std::uint32_t owen_scramble(std::uint32_t bits, std::uint32_t seed) {
    std::uint32_t x = reverse_bits(bits);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverse_bits(x);
}

Vec2 scrambled_sobol2(std::uint32_t index, std::uint64_t seed) {
    const auto p = sobol2(index);
    const std::uint64_t h = hash64(seed);
    return {unit_float(owen_scramble(p[0], static_cast<std::uint32_t>(h))),
            unit_float(owen_scramble(p[1], static_cast<std::uint32_t>(h >> 32)))};
}

Vec2 shuffled_sobol2(std::uint32_t index, std::uint64_t seed) {
    const auto order = static_cast<std::uint32_t>(hash64(seed, 0x5bf03635u));
    // Scrambled as a fraction, an index keeps its aligned block of 2^k together, hence stratified.
    return scrambled_sobol2(owen_scramble(index, order), seed);
}

Vec2 spiral_point(float k, int count, float turn) {
    constexpr float golden_section = 0.38196601f;
    const float radius = std::sqrt(k / static_cast<float>(count));
    const float phi = two_pi * (turn + golden_section * k);
    return {radius * std::cos(phi), radius * std::sin(phi)};
}

Vec3 sample_cosine(const Vec2& u) {
    return from_polar(std::sqrt(1.0f - u.x()), two_pi * u.y());
}

Vec3 sample_vector_irradiance(const Vec2& u) {
    // The distribution function of c = cos(theta) is (c^2 + c) / 2; 1 - u keeps c > 0.
    return from_polar(0.5f * (-1.0f + std::sqrt(1.0f + 8.0f * (1.0f - u.x()))), two_pi * u.y());
}

Vec3 sample_cone(const Vec2& u, float height) {
    return from_polar(1.0f - u.x() * height, two_pi * u.y());
}

Vec3 sample_sphere(const Vec2& u) {
    return from_polar(1.0f - 2.0f * u.x(), two_pi * u.y());
}

} // namespace afterglow
