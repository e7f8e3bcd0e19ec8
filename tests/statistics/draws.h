#pragma once

#include <cstdint>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

namespace afterglow {

/// What one sampler gives, counted by cells of its domain.
struct Draws {
    std::vector<double> probability; // of the cells, by the density that the sampler claims
    std::vector<std::uint64_t> counts;
};

/// A sampler of the project and what is known of it.
struct SamplerCase {
    std::string name;
    std::size_t cells = 0;
    /// Takes about `draws` independent draws (at least so many), with a relative error put in.
    std::function<Draws(std::uint64_t draws, double error)> draw;
    /// sum (p' - p)^2 / p of a small error e, in units of e^2.
    double effect = 1.0;
};

/// How a failed test names it.
inline void PrintTo(const SamplerCase& sampler, std::ostream* out) {
    *out << sampler.name;
}

/// Every sampler whose draws are random, from Rng, from a scrambled sequence or from both.
const std::vector<SamplerCase>& sampler_cases();

} // namespace afterglow
