#pragma once

#include "core/types.h"

#include <array>
#include <cmath>
#include <cstdint>

namespace afterglow {

/// A good 64-bit mix (Stafford's variant 13 of the MurmurHash3 finaliser).
constexpr std::uint64_t hash64(std::uint64_t x) {
    x ^= x >> 30;
    x *= 0xbf58476d1ce4e5b9ULL;
    x ^= x >> 27;
    x *= 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}
constexpr std::uint64_t hash64(std::uint64_t a, std::uint64_t b) {
    return hash64(hash64(a + 0x9e3779b97f4a7c15ULL) ^ (b + 0x632be59bd9b4e019ULL));
}

/// The largest float below one.
inline constexpr float one_minus_epsilon = 0x1.fffffep-1f;

/// [0,1) from the upper 24 bits of a 32-bit integer.
inline float unit_float(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

/// Independent random numbers: stream (seed, item) never meets another (SplitMix64 on a hashed start).
class Rng {
public:
    Rng(std::uint64_t seed, std::uint64_t item) : state_(hash64(seed, item)) {}
    std::uint64_t next() { return hash64(state_ += 0x9e3779b97f4a7c15ULL); }
    float uniform() { return unit_float(static_cast<std::uint32_t>(next() >> 32)); }

private:
    std::uint64_t state_;
};

/// The first two dimensions of Sobol's sequence as 32-bit fractions; a (0,2)-sequence in base 2, so
/// that every aligned block of 2^k points is stratified on each of its elementary intervals.
std::array<std::uint32_t, 2> sobol2(std::uint32_t index);

/// Owen scrambling of one coordinate by hashing (Laine and Karras 2011, constants of Vegdahl 2021).
std::uint32_t owen_scramble(std::uint32_t bits, std::uint32_t seed);

/// The index-th point of an Owen-scrambled (0,2)-sequence in [0,1)^2; one sequence a seed.
Vec2 scrambled_sobol2(std::uint32_t index, std::uint64_t seed);

/// The same, its order shuffled as well, so that several seeds may serve as further dimensions of
/// one sample (padding; Burley 2020).
Vec2 shuffled_sobol2(std::uint32_t index, std::uint64_t seed);

/// An orthonormal frame whose third axis is n (Duff et al. 2017).
struct Frame {
    Vec3 x, y, z;
    explicit Frame(const Vec3& n) : z(n) {
        const float sign = std::copysign(1.0f, n.z());
        const float a = -1.0f / (sign + n.z());
        const float b = n.x() * n.y() * a;
        x = Vec3(1.0f + sign * n.x() * n.x() * a, sign * b, -sign * n.x());
        y = Vec3(b, sign + n.y() * n.y() * a, -n.y());
    }
    Vec3 to_world(const Vec3& v) const { return v.x() * x + v.y() * y + v.z() * z; }
};

/// Place k of `count` on the unit disc, equally many on equal areas: a spiral by the golden section (Vogel
/// 1979) from the centre, where k = 0 is. `turn`: of the whole, in turns.
Vec2 spiral_point(float k, int count, float turn = 0.0f);

/// Direction about +z with density cos(theta) / pi.
Vec3 sample_cosine(const Vec2& u);

/// Direction about +z with density (cos(theta) + 1/2) / (2 pi): the weights of all three components
/// of a vector-irradiance estimate stay bounded, which cosine sampling does not give.
Vec3 sample_vector_irradiance(const Vec2& u);
inline float vector_irradiance_pdf(float cos_theta) {
    return (cos_theta + 0.5f) * static_cast<float>(0.5 / EIGEN_PI);
}

/// Uniform direction within the cone about +z whose spherical cap is `height` = 1 - cos(half-angle)
/// high, density 1 / (2 pi height).
Vec3 sample_cone(const Vec2& u, float height);

/// Uniform direction over the whole sphere, density 1 / (4 pi).
Vec3 sample_sphere(const Vec2& u);

} // namespace afterglow
