#include "tests/statistics/draws.h"

#include "basis/candidates.h"
#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "core/surface.h"
#include "tests/statistics/knobs.h"
#include "tests/support/surface_samples.h"
#include "transport/gather.h"
#include "transport/light_vertices.h"
#include "transport/path_tracer.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <optional>

namespace afterglow {
namespace {

using std::numbers::pi;

/// Draw number k of a sampler whose seeds follow from `seed`: a cell.
using CellOf = std::function<std::size_t(std::uint64_t k, std::uint64_t seed)>;

/// The error that any sampler may have: of the draws that should fall into the first half of the
/// cells, a share falls into the second. The cells there become more likely by the share, or by
/// more where the second half has less than half of the draws.
class Misplacement {
public:
    Misplacement(const std::vector<double>& probability, double share, std::uint64_t seed)
        : share_(share), rng_(seed, 0) {
        double below = 0.0;
        while (below < 0.5 - 1e-9) below += probability[half_++];
    }
    bool misplaces(std::size_t cell) {
        return cell < half_ && rng_.uniform() < static_cast<float>(share_);
    }
    bool is_below(std::size_t cell) const { return cell < half_; }

private:
    std::size_t half_ = 0;
    double share_;
    Rng rng_;
};

Draws count(std::uint64_t draws, double error, std::vector<double> probability,
            const CellOf& cell_of) {
    Draws result{std::move(probability), {}};
    result.counts.resize(result.probability.size());
    const std::uint64_t seed = test_seed(1);
    Misplacement misplacement(result.probability, error, test_seed(2));
    std::uint64_t next = 0;
    for (std::uint64_t n = 0; n < draws; ++n) {
        std::size_t cell = cell_of(next++, seed);
        if (misplacement.misplaces(cell))
            do cell = cell_of(next++, seed);
            while (misplacement.is_below(cell));
        ++result.counts[cell];
    }
    return result;
}

/// A number of [0, 1] as one of n equal parts.
std::size_t part(double u, std::size_t n) {
    return std::min(static_cast<std::size_t>(std::max(0.0, u) * static_cast<double>(n)), n - 1);
}

/// Points uniform over the unit cube of D dimensions, counted by side^D cells.
template <std::size_t D>
SamplerCase uniform_case(std::string name, std::size_t side,
                         std::function<std::array<float, D>(std::uint64_t k, std::uint64_t seed)> point) {
    std::size_t cells = 1;
    for (std::size_t d = 0; d < D; ++d) cells *= side;
    return {std::move(name), cells, [=](std::uint64_t draws, double error) {
                const std::vector<double> probability(cells, 1.0 / static_cast<double>(cells));
                return count(draws, error, probability, [=](std::uint64_t k, std::uint64_t seed) {
                    std::size_t cell = 0;
                    for (const float u : point(k, seed)) {
                        assert(u >= 0.0f && u < 1.0f);
                        cell = side * cell + part(u, side);
                    }
                    return cell;
                });
            }};
}

/// Directions about +z, uniform in azimuth, counted by 16 x 8 cells in cosine and azimuth.
SamplerCase direction_case(std::string name, double lowest_cosine,
                           std::function<double(double cosine)> pdf, // per solid angle
                           std::function<Vec3(std::uint64_t k, std::uint64_t seed)> direction) {
    constexpr std::size_t rows = 16, columns = 8;
    return {std::move(name), rows * columns, [=](std::uint64_t draws, double error) {
                const double height = (1.0 - lowest_cosine) / rows;
                std::vector<double> probability(rows * columns, 0.0);
                constexpr std::size_t steps = 2000; // midpoint rule; the densities have kinks
                for (std::size_t s = 0; s < rows * steps; ++s) {
                    const double cosine = lowest_cosine + (static_cast<double>(s) + 0.5) * height / steps;
                    for (std::size_t c = 0; c < columns; ++c)
                        probability[s / steps * columns + c] +=
                            2.0 * pi * pdf(cosine) * height / steps / columns;
                }
                return count(draws, error, probability, [=](std::uint64_t k, std::uint64_t seed) {
                    const Vec3 d = direction(k, seed);
                    const double turn = std::atan2(d.y(), d.x()) / (2.0 * pi);
                    return part((d.z() - lowest_cosine) / (1.0 - lowest_cosine), rows) * columns
                           + part(turn < 0.0 ? turn + 1.0 : turn, columns);
                });
            }};
}

Vec2 uniform2(std::uint64_t k, std::uint64_t seed) {
    Rng rng(seed, k);
    const float u = rng.uniform();
    return {u, rng.uniform()};
}

SamplerCase cone_case(const std::string& name, float inner, float outer) {
    Spotlight light{.direction = Vec3::UnitZ(), .inner_angle = inner, .outer_angle = outer};
    light.check();
    const ConeSampler sampler(light);
    return direction_case(
        name, std::cos(outer * pi / 180.0),
        [=](double cosine) { return sampler.pdf(static_cast<float>(cosine)); },
        [=](std::uint64_t k, std::uint64_t seed) { return sampler.direction(uniform2(k, seed)); });
}

/// One ray of a receiver of each digital shift: those of one shift depend on each other.
Vec3 gather_direction(std::uint64_t k, std::uint64_t seed) {
    constexpr int rays = 16;
    Rng choice(hash64(seed, 1), k); // not a fixed column: a receiver's are sorted by direction
    const auto receiver = static_cast<Index>(choice.next() % 1000);
    const auto column = static_cast<Index>(choice.next() % rays);
    Eigen::Matrix3Xf directions;
    GatherDirections(rays, hash64(seed, k)).deal(receiver, directions);
    return directions.col(column);
}

/// The axis along which a place of an axis-parallel box lies farthest out, and its side.
struct Face {
    int axis;
    bool upper;
    std::size_t number() const { return 2 * static_cast<std::size_t>(axis) + upper; }
};
Face face_of(const Vec3& in_box) { // the box is [-1, 1]^3
    int axis = 0;
    in_box.cwiseAbs().maxCoeff(&axis);
    return {axis, in_box[axis] > 0.0f};
}

/// Number of the cell, side^2 a face.
std::size_t box_cell(const Vec3& in_box, std::size_t side) {
    const Face face = face_of(in_box);
    const auto share = [&](int axis) { return 0.5 * (1.0 + in_box[axis]); };
    return (face.number() * side + part(share((face.axis + 1) % 3), side)) * side
           + part(share((face.axis + 2) % 3), side);
}

/// Where the rays of a light end in a box, against the density by area that the path tracer weighs
/// them with.
SamplerCase light_vertex_case() {
    constexpr std::size_t side = 5, cells = 6 * side * side;
    return {"LightVertices", cells, [](std::uint64_t draws, double error) {
                static const Scene scene = make_builtin_scene("builtin:furnace");
                static const Surface surface(scene);
                Spotlight light{.position = Vec3(0.2f, 0.3f, -0.1f),
                                .direction = Vec3(-0.3f, -1.0f, 0.2f),
                                .inner_angle = 20.0f,
                                .outer_angle = 75.0f};
                light.check();
                const ConeSampler sampler(light);
                std::vector<double> probability(cells, 0.0);
                constexpr std::size_t steps = 40 * side; // of the midpoint rule along a side of 2
                for (int axis = 0; axis < 3; ++axis)
                    for (const float end : {-1.0f, 1.0f})
                        for (std::size_t i = 0; i < steps * steps; ++i) {
                            const auto at = [](std::size_t s) {
                                return static_cast<float>((s + 0.5) * 2.0 / steps - 1.0);
                            };
                            Vec3 y;
                            y[axis] = end;
                            y[(axis + 1) % 3] = at(i / steps);
                            y[(axis + 2) % 3] = at(i % steps);
                            const Vec3 inwards = -end * Vec3::Unit(axis);
                            probability[box_cell(y, side)] +=
                                light_vertex_pdf(sampler, light, y, inwards) * 4.0 / (steps * steps);
                        }
                return count(draws, error, probability, [&](std::uint64_t k, std::uint64_t seed) {
                    const auto index = static_cast<std::uint32_t>(k % 64);
                    LightVertex y;
                    trace_light_vertices(surface, light, sampler, hash64(seed, k), {&index, 1}, {&y, 1});
                    return box_cell(y.x.position, side);
                });
            }};
}

/// Points of a box of 2 x 6 x 4 by area: faces of three sizes.
SamplerCase area_case() {
    constexpr std::size_t side = 4, cells = 6 * side * side;
    return {"PointsByArea", cells, [](std::uint64_t draws, double error) {
                const Vec3 stretch(1.0f, 3.0f, 2.0f);
                Scene scene = make_builtin_scene("builtin:furnace");
                for (Vec3& p : scene.positions) p = p.cwiseProduct(stretch);
                const std::array<double, 3> area = {24.0, 8.0, 12.0}; // of a face across x, y, z
                std::vector<double> probability;
                for (std::size_t cell = 0; cell < cells; ++cell)
                    probability.push_back(area[cell / (2 * side * side)] / 88.0 / (side * side));
                return count(draws, error, probability, [&](std::uint64_t k, std::uint64_t seed) {
                    const SurfacePoint x = points_by_area(scene, 1, hash64(seed, k)).front();
                    return box_cell(x.position.cwiseQuotient(stretch), side);
                });
            }};
}

/// In a closed sphere, diffuse reflection leads from any place to all with equal density by area, so
/// that the vertices of a particle's path are independent and uniform.
SamplerCase candidate_case() {
    constexpr std::size_t rows = 8, columns = 16;
    return {"Candidates", rows * columns, [](std::uint64_t draws, double error) {
                static const Scene scene = make_builtin_scene("builtin:sphere:0.5");
                static const Surface surface(scene);
                std::vector<std::size_t> cell; // a triangle each
                std::vector<double> probability(rows * columns, 0.0);
                double total = 0.0;
                for (const Triangle& t : scene.triangles) {
                    const Vec3 a = scene.positions[t[0]], b = scene.positions[t[1]],
                               c = scene.positions[t[2]];
                    const Vec3 centre = (a + b + c).normalized();
                    const double turn = 0.5 + 0.5 * std::atan2(centre.y(), centre.x()) / pi;
                    cell.push_back(part(0.5 + 0.5 * centre.z(), rows) * columns + part(turn, columns));
                    const double area = 0.5 * (b - a).cross(c - a).norm();
                    probability[cell.back()] += area;
                    total += area;
                }
                for (double& p : probability) p /= total;
                CandidateSource source(surface, {Vec3(0.3f, -0.2f, 0.4f)}, test_seed(3));
                return count(draws, error, probability, [&](std::uint64_t k, std::uint64_t) {
                    source.ensure(k + 1);
                    return cell[source[k].hit.primitive];
                });
            }};
}

/// In a closed box of reflectance rho, Russian roulette lets a path go on with probability rho at each
/// vertex. Without light a path costs one ray a vertex, so that two paths take r rays with
/// probability (r - 1) rho^(r - 2) (1 - rho)^2. The error is one of the probability to go on.
SamplerCase roulette_case() {
    static constexpr double rho = 0.8;
    static constexpr std::size_t most = 60; // and more
    SamplerCase result{"RussianRoulette", most, [](std::uint64_t draws, double error) {
                std::vector<double> probability(most, 0.0);
                double rest = 1.0;
                for (std::size_t r = 2; r < most; ++r)
                    rest -= probability[r - 1] = static_cast<double>(r - 1)
                                                 * std::pow(rho, static_cast<double>(r - 2))
                                                 * (1.0 - rho) * (1.0 - rho);
                probability.back() += rest;
                const Scene scene =
                    make_builtin_scene("builtin:furnace:" + std::to_string(rho * (1.0 + error)));
                const Surface surface(scene);
                const Spotlight dark{.intensity = Rgb::Zero()};
                const SurfacePoint x{Vec3(0.1f, -1.0f, 0.2f), Vec3::UnitY()};
                return count(draws, 0.0, probability, [&](std::uint64_t k, std::uint64_t seed) {
                    const IrradianceEstimate two = estimate_irradiance(
                        surface, {&dark, 1}, {&x, 1},
                        {.samples = 2, .batches = 2, .seed = hash64(seed, k)});
                    return std::min<std::size_t>(two.rays, most) - 1;
                });
            }};
    // The Fisher information of two geometric distributions: 2 rho / (1 - rho)^2 for a relative error.
    result.effect = 2.0 * rho / ((1.0 - rho) * (1.0 - rho));
    return result;
}

/// A wall under uniform light on which each pixel sees the same 4 x 4 cells. A cell's reflectance is a
/// digit in base 3, six to a colour: two samples to a pixel, and its value counts both by cells.
class PatternedWall {
public:
    static constexpr int side = 4, pixels = 24, digits = 6;

    PatternedWall() {
        camera_ = {.position = Vec3::Zero(), .target = -Vec3::UnitZ(), .width = pixels, .height = pixels};
        camera_.check();
        const float step = camera_.pixel_size() / side, half = camera_.half_height();
        for (int cell = 0; cell < side * side; ++cell) {
            Material material;
            material.reflectance = Rgb::Zero();
            material.reflectance[cell / digits] = std::pow(3.0f, static_cast<float>(-(cell % digits)));
            scene_.materials.push_back(material);
        }
        constexpr std::uint32_t row = side * pixels + 1;
        for (std::uint32_t y = 0; y < row; ++y)
            for (std::uint32_t x = 0; x < row; ++x)
                scene_.positions.emplace_back(static_cast<float>(x) * step - half,
                                              half - static_cast<float>(y) * step, -1.0f);
        for (std::uint32_t y = 0; y + 1 < row; ++y)
            for (std::uint32_t x = 0; x + 1 < row; ++x) {
                const std::uint32_t corner = y * row + x;
                scene_.triangles.push_back({corner, corner + row, corner + row + 1});
                scene_.triangles.push_back({corner, corner + row + 1, corner + 1});
                scene_.material_index.insert(scene_.material_index.end(), 2, y % side * side + x % side);
            }
        surface_.emplace(scene_);
    }

    /// The cells of the two samples of each pixel.
    std::vector<std::size_t> cells_of_samples(std::uint64_t seed) const {
        constexpr float distance = 2000.0f; // the light's: uniform on the wall to 1e-6
        Spotlight light{.position = Vec3(0.0f, 0.0f, distance),
                        .direction = -Vec3::UnitZ(),
                        .inner_angle = 10.0f,
                        .outer_angle = 20.0f,
                        .intensity = Rgb::Constant(distance * distance)};
        const Image image = render_reference(*surface_, light, camera_, Layer::direct,
                                             {.samples = 2, .batches = 2, .seed = seed})
                                .image;
        std::vector<std::size_t> cells;
        for (int pixel = 0; pixel < pixels * pixels; ++pixel)
            for (int colour = 0; colour < 3; ++colour) {
                const double sum = image.rgb[static_cast<std::size_t>(3 * pixel + colour)] * 2.0 * pi;
                auto number = std::lround(sum * std::pow(3.0, digits - 1));
                for (int digit = digits - 1; digit >= 0; --digit, number /= 3)
                    cells.insert(cells.end(), static_cast<std::size_t>(number % 3),
                                 static_cast<std::size_t>(digits * colour + digit));
            }
        return cells;
    }

private:
    Scene scene_;
    std::optional<Surface> surface_;
    Camera camera_;
};

SamplerCase jitter_case() {
    constexpr std::size_t cells = PatternedWall::side * PatternedWall::side;
    return {"PixelJitter", cells, [](std::uint64_t draws, double error) {
                const PatternedWall wall;
                std::vector<std::size_t> samples;
                std::uint64_t pictures = 0;
                const std::vector<double> probability(cells, 1.0 / static_cast<double>(cells));
                return count(draws, error, probability, [&](std::uint64_t k, std::uint64_t seed) {
                    while (k >= samples.size()) {
                        const auto more = wall.cells_of_samples(hash64(seed, pictures++));
                        samples.insert(samples.end(), more.begin(), more.end());
                    }
                    return samples[k];
                });
            }};
}

std::vector<SamplerCase> make_cases() {
    using std::uint32_t, std::uint64_t;
    const auto index = [](uint64_t k) { return static_cast<uint32_t>(k % 1000); };
    std::vector<SamplerCase> cases;
    cases.push_back(uniform_case<3>("RngAlongAStream", 6, [](uint64_t k, uint64_t seed) {
        Rng rng(seed, k);
        std::array<float, 3> u{};
        for (float& x : u) x = rng.uniform();
        return u;
    }));
    cases.push_back(uniform_case<2>("RngOfNeighbouringItems", 16, [](uint64_t k, uint64_t seed) {
        return std::array{Rng(seed, 2 * k).uniform(), Rng(seed, 2 * k + 1).uniform()};
    }));
    cases.push_back(uniform_case<2>("RngOfNeighbouringSeeds", 16, [](uint64_t k, uint64_t seed) {
        return std::array{Rng(seed + 2 * k, 5).uniform(), Rng(seed + 2 * k + 1, 5).uniform()};
    }));
    cases.push_back(uniform_case<2>("HashOfNeighbouringNumbers", 16, [](uint64_t k, uint64_t seed) {
        const auto turn = [](uint64_t n) { return unit_float(static_cast<uint32_t>(hash64(n))); };
        const uint64_t first = seed >> 40; // small numbers, as ids are
        return std::array{turn(first + 2 * k), turn(first + 2 * k + 1)};
    }));
    cases.push_back(uniform_case<2>("ScrambledSobolOverSeeds", 16, [=](uint64_t k, uint64_t seed) {
        const Vec2 u = scrambled_sobol2(index(k), seed + k);
        return std::array{u.x(), u.y()};
    }));
    cases.push_back(uniform_case<2>("ShuffledSobolOverSeeds", 16, [=](uint64_t k, uint64_t seed) {
        const Vec2 u = shuffled_sobol2(index(k), seed + k);
        return std::array{u.x(), u.y()};
    }));
    // Two bounces of a path, as the path tracer pads its dimensions.
    cases.push_back(uniform_case<4>("TwoBouncesOfAPath", 4, [=](uint64_t k, uint64_t seed) {
        const uint64_t path_seed = hash64(seed, k);
        const Vec2 u = shuffled_sobol2(index(k), hash64(path_seed, 0));
        const Vec2 v = shuffled_sobol2(index(k), hash64(path_seed, 1));
        return std::array{u.x(), u.y(), v.x(), v.y()};
    }));
    // What decides whether a path goes on must not know in which direction it went.
    cases.push_back(uniform_case<3>("DirectionAndRoulette", 6, [=](uint64_t k, uint64_t seed) {
        const uint64_t bounce_seed = hash64(hash64(seed, k), 0);
        const Vec2 u = shuffled_sobol2(index(k), bounce_seed);
        return std::array{u.x(), u.y(), Rng(bounce_seed, index(k)).uniform()};
    }));
    // First and second direction of the display's paths out of gaps.
    cases.push_back(uniform_case<4>("TwoBouncesInAGap", 4, [=](uint64_t k, uint64_t seed) {
        const uint64_t place = hash64(seed, k);
        const Vec2 u = scrambled_sobol2(index(k), place);
        const Vec2 v = uniform2(index(k), place);
        return std::array{u.x(), u.y(), v.x(), v.y()};
    }));

    cases.push_back(direction_case(
        "CosineDirections", 0.0, [](double c) { return c / pi; },
        [](uint64_t k, uint64_t seed) { return sample_cosine(uniform2(k, seed)); }));
    const auto vector_pdf = [](double c) { return double{vector_irradiance_pdf(static_cast<float>(c))}; };
    cases.push_back(direction_case(
        "VectorIrradianceDirections", 0.0, vector_pdf,
        [](uint64_t k, uint64_t seed) { return sample_vector_irradiance(uniform2(k, seed)); }));
    cases.push_back(direction_case("GatherDirectionsOverShifts", 0.0, vector_pdf, gather_direction));
    cases.push_back(direction_case(
        "SphereDirections", -1.0, [](double) { return 0.25 / pi; },
        [](uint64_t k, uint64_t seed) { return sample_sphere(uniform2(k, seed)); }));
    cases.push_back(direction_case(
        "ConeDirections", 0.75, [](double) { return 0.5 / pi / 0.25; },
        [](uint64_t k, uint64_t seed) { return sample_cone(uniform2(k, seed), 0.25f); }));
    cases.push_back(cone_case("SoftSpotlight", 20.0f, 60.0f));
    cases.push_back(cone_case("HardSpotlight", 30.0f, 30.0f));
    cases.push_back(cone_case("WideSpotlight", 60.0f, 170.0f));
    cases.push_back(light_vertex_case());
    cases.push_back(area_case());
    cases.push_back(candidate_case());
    cases.push_back(roulette_case());
    cases.push_back(jitter_case());
    return cases;
}

} // namespace

const std::vector<SamplerCase>& sampler_cases() {
    static const std::vector<SamplerCase> cases = make_cases();
    return cases;
}

} // namespace afterglow
