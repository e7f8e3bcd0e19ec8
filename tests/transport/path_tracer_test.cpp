#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "tests/support/surface_samples.h"
#include "transport/path_tracer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <tuple>
#include <vector>

namespace afterglow {
namespace {

using std::numbers::pi;

struct MeanAndError {
    double mean = 0.0, error = 0.0;
};

/// Mean over points and channels with the error that the choice of the points adds.
MeanAndError over_points(const Eigen::Array3Xf& values) {
    const Eigen::ArrayXd v = values.cast<double>().colwise().mean().transpose();
    const double n = static_cast<double>(v.size());
    return {v.mean(), std::sqrt((v - v.mean()).square().sum() / (n * (n - 1.0)))};
}

/// Four standard errors, of which a relative error of 2 % would be at least seven: an estimate that
/// is wrong by 2 % fails (but for one run in a thousand).
void expect_equal_within_noise(double measured, double exact, double error,
                               const std::string& what) {
    EXPECT_LT(std::abs(measured - exact), 4.0 * error)
        << what << ": " << measured << " +- " << error << ", exact " << exact;
    EXPECT_GT(0.02 * exact / error, 7.0) << what << ": this test could not see an error of 2 %";
}

Spotlight hard_spot(const Vec3& position, const Vec3& direction, float angle) {
    Spotlight light{.position = position,
                    .direction = direction,
                    .inner_angle = angle,
                    .outer_angle = angle,
                    .intensity = Rgb::Constant(2.0f)};
    light.check();
    return light;
}

double flux(const Spotlight& hard) {
    return hard.intensity[0] * 2.0 * pi * (1.0 - std::cos(hard.outer_angle * pi / 180.0));
}

class Furnace : public testing::TestWithParam<std::tuple<const char*, PathStrategy>> {};

TEST_P(Furnace, IndirectIrradianceInAClosedSphereIsUniformAndFollowsFromTheFlux) {
    const auto [reflectance, strategy] = GetParam();
    const double rho = std::stod(reflectance);
    const Scene scene = make_builtin_scene("builtin:sphere:" + std::string(reflectance));
    const Surface surface(scene);
    const Spotlight light = hard_spot(Vec3(0.1f, 0.2f, 0.3f), Vec3(0.3f, -1.0f, 0.2f), 70.0f);
    const std::vector<SurfacePoint> points = points_by_area(scene, 64, 3);
    const IrradianceEstimate estimate =
        estimate_irradiance(surface, {&light, 1}, points,
                            {.samples = rho > 0.9 ? 2304 : 4096, .seed = 5, .strategy = strategy});

    const double exact = rho / (1.0 - rho) * flux(light) / (4.0 * pi);
    const double error =
        std::sqrt(estimate.standard_error.row(1).cast<double>().square().sum()) / 64.0;
    expect_equal_within_noise(estimate.indirect.row(1).cast<double>().mean(), exact, error, "mean");
    for (Index k = 0; k < 64; ++k)
        EXPECT_NEAR(estimate.indirect(1, k), exact, 6.5 * estimate.standard_error(1, k))
            << "at " << points[static_cast<std::size_t>(k)].position.transpose();
}

TEST_P(Furnace, MeanIrradianceInAClosedBoxIsFluxOverAbsorbedShare) {
    const auto [reflectance, strategy] = GetParam();
    const double rho = std::stod(reflectance);
    const Scene scene = make_builtin_scene("builtin:furnace:" + std::string(reflectance));
    const Surface surface(scene);
    const Spotlight light = hard_spot(Vec3(-0.3f, 0.4f, 0.1f), Vec3(1.0f, -0.7f, 0.2f), 75.0f);
    const IrradianceEstimate estimate = estimate_irradiance(
        surface, {&light, 1}, points_by_area(scene, rho < 0.5 ? 20000 : 8192, 4),
        {.samples = rho > 0.9 || rho < 0.5 ? 32 : 64, .seed = 6, .strategy = strategy});

    const double direct = flux(light) / 24.0; // six faces of 2 x 2
    const MeanAndError indirect = over_points(estimate.indirect);
    expect_equal_within_noise(indirect.mean, rho / (1.0 - rho) * direct, indirect.error,
                              "indirect");
    const MeanAndError measured_direct = over_points(estimate.direct);
    EXPECT_NEAR(measured_direct.mean, direct, 4.0 * measured_direct.error);
}

std::string furnace_name(const testing::TestParamInfo<Furnace::ParamType>& furnace) {
    const auto [reflectance, strategy] = furnace.param;
    return std::string(strategy == PathStrategy::plain ? "Plain" : "Connected")
           + std::to_string(std::lround(100.0 * std::stod(reflectance)));
}

INSTANTIATE_TEST_SUITE_P(Strategies, Furnace,
                         testing::Combine(testing::Values("0.2", "0.5", "0.8", "0.95"),
                                          testing::Values(PathStrategy::plain,
                                                          PathStrategy::connected)),
                         furnace_name);

/// The rectangle [0, a] x [0, b] at z = 0, facing +z.
Scene rectangle(float a, float b, float reflectance) {
    Scene scene;
    scene.name = "rectangle";
    scene.positions = {Vec3(0, 0, 0), Vec3(a, 0, 0), Vec3(a, b, 0), Vec3(0, b, 0)};
    scene.triangles = {{0, 1, 2}, {0, 2, 3}};
    scene.material_index = {0, 0};
    Material grey;
    grey.reflectance = Rgb::Constant(reflectance);
    scene.materials = {grey};
    return scene;
}

// A distant light makes the irradiance of the rectangle uniform to 1e-6; the light of one bounce at
// a point is then reflectance x irradiance x form factor (catalogue of J. Howell, C-3 and C-4).
TEST(PathTracer, OneBounceFromAUniformRectangleIsItsFormFactor) {
    constexpr float a = 1.5f, b = 0.8f, reflectance = 0.6f, distance = 2000.0f;
    const Scene scene = rectangle(a, b, reflectance);
    const Surface surface(scene);
    Spotlight light{.position = Vec3(0.75f, 0.4f, distance),
                    .direction = -Vec3::UnitZ(),
                    .inner_angle = 10.0f,
                    .outer_angle = 20.0f,
                    .intensity = Rgb::Constant(distance * distance)};
    light.check();
    for (const float c : {0.2f, 0.7f, 2.0f}) {
        const std::vector<SurfacePoint> points = {{Vec3(0.0f, 0.0f, c), -Vec3::UnitZ()},
                                                  {Vec3(0.0f, 0.0f, c), Vec3::UnitX()}};
        const double h = c, root_a = std::sqrt(h * h + double{a} * a),
                     root_b = std::sqrt(h * h + double{b} * b);
        const double parallel =
            (a / root_a * std::atan(b / root_a) + b / root_b * std::atan(a / root_b)) / (2.0 * pi);
        const double perpendicular =
            (std::atan(b / h) - h / root_a * std::atan(b / root_a)) / (2.0 * pi);
        const IrradianceEstimate e =
            estimate_irradiance(surface, {&light, 1}, points, {.samples = 1 << 18, .seed = 2});
        expect_equal_within_noise(e.indirect(0, 0), reflectance * parallel, e.standard_error(0, 0),
                                  "parallel at " + std::to_string(c));
        expect_equal_within_noise(e.indirect(0, 1), reflectance * perpendicular,
                                  e.standard_error(0, 1), "perpendicular at " + std::to_string(c));
    }
}

class InTheCornellBox : public testing::Test {
protected:
    Scene scene = make_builtin_scene("builtin:cornell");
    Surface surface{scene};
    std::vector<Spotlight> lights = {
        hard_spot(Vec3(0.278f, 0.54f, 0.28f), Vec3(0.2f, -1.0f, 0.1f), 40.0f),
        hard_spot(Vec3(0.278f, 0.273f, -0.8f), Vec3(0.1f, 0.1f, 1.0f), 15.0f)};
    std::vector<SurfacePoint> points = points_by_area(scene, 256, 8);
};

TEST_F(InTheCornellBox, SameBytesOnAnyNumberOfThreads) {
    for (const double target : {0.0, 0.05}) {
        const PathTracerOptions options{.samples = 128, .target_error = target, .seed = 3};
        std::vector<IrradianceEstimate> runs;
        for (const int threads : {1, 2, 5}) {
            const ThreadLimit limit(threads);
            runs.push_back(estimate_irradiance(surface, lights, points, options));
        }
        for (const IrradianceEstimate& run : runs) {
            EXPECT_TRUE((run.indirect == runs[0].indirect).all());
            EXPECT_TRUE((run.standard_error == runs[0].standard_error).all());
            EXPECT_TRUE((run.direct == runs[0].direct).all());
            EXPECT_EQ(run.rays, runs[0].rays);
        }
    }
}

TEST_F(InTheCornellBox, ALightSeesTheSameInCompanyAsAlone) {
    const PathTracerOptions options{.samples = 64, .seed = 3};
    const IrradianceEstimate both = estimate_irradiance(surface, lights, points, options);
    for (std::size_t l = 0; l < lights.size(); ++l) {
        const IrradianceEstimate alone =
            estimate_irradiance(surface, {&lights[l], 1}, points, options);
        for (Index p = 0; p < 256; ++p)
            EXPECT_TRUE(
                (both.indirect.col(2 * p + static_cast<Index>(l)) == alone.indirect.col(p)).all());
    }
}

TEST_F(InTheCornellBox, StandardErrorIsHonest) {
    const IrradianceEstimate coarse =
        estimate_irradiance(surface, lights, points, {.samples = 512, .seed = 11});
    const IrradianceEstimate fine =
        estimate_irradiance(surface, lights, points, {.samples = 8192, .seed = 12});
    double squares = 0.0;
    Index count = 0;
    for (Index k = 0; k < coarse.indirect.cols(); ++k) {
        const double variance =
            std::pow(coarse.standard_error(1, k), 2.0) + std::pow(fine.standard_error(1, k), 2.0);
        if (!(fine.indirect(1, k) > 0.0f)) continue; // bottoms of the blocks
        squares += std::pow(coarse.indirect(1, k) - fine.indirect(1, k), 2.0) / variance;
        ++count;
    }
    EXPECT_GT(count, 300);
    // A variance from 16 batches makes z follow Student's t with 15 degrees of freedom: mean of z^2
    // 15/13, variance of z^2 3.4. The two lights share paths; four standard errors of 256 values.
    EXPECT_NEAR(squares / static_cast<double>(count), 15.0 / 13.0, 4.0 * std::sqrt(3.4 / 256.0));
}

TEST_F(InTheCornellBox, ConnectedPathsAgreeWithPlainOnesPointByPoint) {
    const IrradianceEstimate plain =
        estimate_irradiance(surface, lights, points, {.samples = 4096, .seed = 31});
    const IrradianceEstimate connected =
        estimate_irradiance(surface, lights, points,
                            {.samples = 2048, .seed = 32, .strategy = PathStrategy::connected});
    for (std::size_t l = 0; l < lights.size(); ++l) {
        double difference = 0.0, variance = 0.0, mean = 0.0, squares = 0.0;
        Index count = 0;
        for (Index k = static_cast<Index>(l); k < plain.indirect.cols(); k += 2) {
            if (!(plain.indirect(1, k) > 0.0f)) continue; // bottoms of the blocks
            const double d = connected.indirect(1, k) - plain.indirect(1, k);
            const double v = std::pow(connected.standard_error(1, k), 2.0)
                             + std::pow(plain.standard_error(1, k), 2.0);
            difference += d, variance += v, squares += d * d / v, mean += plain.indirect(1, k);
            ++count;
        }
        expect_equal_within_noise(mean + difference, mean, std::sqrt(variance),
                                  "light " + std::to_string(l));
        // As in StandardErrorIsHonest; two errors of 15 degrees of freedom together have 15 to 30.
        EXPECT_NEAR(squares / static_cast<double>(count), 1.1,
                    0.05 + 4.0 * std::sqrt(3.4 / static_cast<double>(count)));
    }
}

TEST_F(InTheCornellBox, ConnectionsLowerTheNoiseOfANarrowSpot) {
    const Spotlight narrow = hard_spot(Vec3(0.278f, 0.54f, 0.28f), Vec3(0.5f, -1.0f, 0.1f), 12.0f);
    const auto error = [&](PathStrategy strategy) {
        return estimate_irradiance(surface, {&narrow, 1}, points,
                                   {.samples = 256, .seed = 33, .strategy = strategy})
            .relative_error[0];
    };
    EXPECT_LT(error(PathStrategy::connected), 0.5 * error(PathStrategy::plain));
}

TEST_F(InTheCornellBox, TargetErrorIsReachedWithoutBias) {
    const IrradianceEstimate estimate =
        estimate_irradiance(surface, lights, points, {.target_error = 0.03, .seed = 21});
    const IrradianceEstimate fine =
        estimate_irradiance(surface, lights, points, {.samples = 8192, .seed = 22});
    for (std::size_t l = 0; l < 2; ++l) {
        EXPECT_LE(estimate.relative_error[l], 0.03);
        double difference = 0.0, variance = 0.0, mean = 0.0;
        for (Index k = static_cast<Index>(l); k < estimate.indirect.cols(); k += 2) {
            difference += estimate.indirect(1, k) - fine.indirect(1, k);
            mean += fine.indirect(1, k);
            variance += std::pow(estimate.standard_error(1, k), 2.0)
                        + std::pow(fine.standard_error(1, k), 2.0);
        }
        expect_equal_within_noise(mean + difference, mean, std::sqrt(variance),
                                  "light " + std::to_string(l));
    }
}

TEST_F(InTheCornellBox, AFullPictureIsDirectPlusIndirectAndBlackOutside) {
    Camera camera{.position = Vec3(0.278f, 0.273f, -1.4f),
                  .target = Vec3(0.278f, 0.273f, 0.0f),
                  .vertical_fov = 35.0f,
                  .width = 24,
                  .height = 16};
    camera.check();
    const auto render = [&](Layer layer) {
        return render_reference(surface, lights[0], camera, layer, {.samples = 16, .seed = 4})
            .image;
    };
    const Image direct = render(Layer::direct), indirect = render(Layer::indirect),
                full = render(Layer::full), irradiance = render(Layer::irradiance);
    int black = 0, lit = 0;
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            EXPECT_TRUE(full.pixel(x, y).isApprox(direct.pixel(x, y) + indirect.pixel(x, y), 1e-5f));
            EXPECT_TRUE((irradiance.pixel(x, y) >= indirect.pixel(x, y)).all());
            black += (irradiance.pixel(x, y) == 0.0f).all();
            lit += (full.pixel(x, y) > 0.0f).all();
        }
    EXPECT_TRUE((full.pixel(0, 0) == 0.0f).all());
    EXPECT_GT(lit, 24 * 16 / 4);
    EXPECT_GT(black, 24 * 16 / 4);
    EXPECT_LT(black, 24 * 16 * 3 / 4);
}

/// The sphere of radius one with normals tilted by `degrees`, in a direction of each triangle's own.
Scene sphere_with_tilted_normals(double degrees) {
    Scene scene = make_builtin_scene("builtin:sphere:0.5");
    const double angle = degrees * pi / 180.0;
    scene.normal_maps = {{1, 1, {static_cast<float>(std::sin(angle)), 0.0f, static_cast<float>(std::cos(angle))}}};
    for (Material& material : scene.materials) material.normal_map = 0;
    scene.texture_coordinates = {{0.0f, 0.0f}, {1.0f, 0.0f}, {0.0f, 1.0f}};
    scene.texture_indices.assign(scene.triangles.size(), {0, 1, 2});
    return scene;
}

// A light in all directions from the centre makes radiance uniform, and B = rho E: under a normal at
// the angle a to the surface's, the half-space above the surface gives (1 + cos a) / 2 of E; all of
// the hemisphere about that normal would give E.
TEST(PathTracer, APictureOfAFurnaceWithNormalMapsIsItsClosedForm) {
    const Spotlight light = hard_spot(Vec3::Zero(), -Vec3::UnitY(), 180.0f);
    Camera camera{.position = Vec3(0.3f, 0.1f, 0.0f), .target = Vec3::UnitX(), .width = 24, .height = 24};
    camera.check();
    for (const double degrees : {0.0, 30.0, 60.0}) {
        const Scene scene = sphere_with_tilted_normals(degrees);
        const Surface surface(scene);
        const double cosine = std::cos(degrees * pi / 180.0);
        for (const PathStrategy strategy : {PathStrategy::plain, PathStrategy::connected}) {
            const auto mean = [&](Layer layer, double& error) {
                const PictureEstimate picture = render_reference(
                    surface, light, camera, layer, {.target_error = 0.05, .seed = 9, .strategy = strategy});
                error = std::max(1e-4, picture.relative_error / 24.0); // the sphere is made of triangles
                return Eigen::ArrayXf::Map(picture.image.rgb.data(), 3 * 24 * 24).cast<double>().mean();
            };
            const std::string what = std::to_string(degrees) + " degrees, " + strategy_name(strategy);
            double error = 0.0;
            const double exact = 2.0 * 0.5 / (1.0 - 0.5) * 0.5 * (1.0 + cosine);
            const double indirect = mean(Layer::irradiance, error);
            expect_equal_within_noise(indirect, exact, error * exact, what);
            const double direct = mean(Layer::direct, error);
            EXPECT_NEAR(direct, 0.5 / pi * 2.0 * cosine, 0.005 * direct) << what;
        }
    }
}

TEST(PathTracer, ANormalMapShowsNoLightFromBelowTheSurface) {
    // A ground whose vertex normals lean by 45 degrees to +x and which its map turns by 75 to -x, where
    // a low wall is lit: above the bent normal's horizon, and below the surface's, as its own normal says.
    const double turn = 75.0 * pi / 180.0;
    Scene leaning;
    leaning.positions = {{-0.2f, 0, -0.2f}, {0.2f, 0, -0.2f}, {0.2f, 0, 0.2f}, {-0.2f, 0, 0.2f},
                         {-2, 0, -1},       {-2, 0.95f, -1},  {-2, 0.95f, 1},  {-2, 0, 1}};
    leaning.triangles = {{2, 1, 0}, {3, 2, 0}, {4, 5, 6}, {4, 6, 7}};
    leaning.normals = {Vec3(1, 1, 0).normalized()};
    const Triangle none = {no_index, no_index, no_index};
    leaning.normal_indices = {{0, 0, 0}, {0, 0, 0}, none, none};
    leaning.texture_coordinates = {{0, 0}, {1, 0}, {1, 1}, {0, 1}}; // u along x
    leaning.texture_indices = {{2, 1, 0}, {3, 2, 0}, none, none};
    leaning.materials.resize(1);
    leaning.materials[0].normal_map = 0;
    leaning.material_index.assign(4, 0);
    leaning.normal_maps = {{1, 1, {static_cast<float>(-std::sin(turn)), 0.0f, static_cast<float>(std::cos(turn))}}};
    Scene upright = leaning; // the same map shows the wall where the surface does not lean away
    upright.normal_indices.clear();

    const Vec3 beside_wall(-1.5f, 0.5f, 0);
    Camera camera{.position = Vec3(0, 3, 0), .target = Vec3::Zero(), .up = Vec3::UnitX(), .vertical_fov = 5.0f, .width = 8, .height = 8};
    camera.check();
    for (const PathStrategy strategy : {PathStrategy::plain, PathStrategy::connected})
        for (const Layer layer : {Layer::indirect, Layer::direct}) {
            const Vec3 direction = layer == Layer::indirect ? Vec3(-Vec3::UnitX()) : Vec3(-beside_wall);
            const Spotlight light = hard_spot(beside_wall, direction, 40.0f);
            const auto brightest = [&](const Scene& scene) {
                const Surface surface(scene);
                const Image image = render_reference(surface, light, camera, layer, {.samples = 256, .seed = 2, .strategy = strategy}).image;
                return *std::max_element(image.rgb.begin(), image.rgb.end());
            };
            EXPECT_EQ(brightest(leaning), 0.0f) << layer_name(layer) << ", " << strategy_name(strategy);
            EXPECT_GT(brightest(upright), 0.0f) << layer_name(layer) << ", " << strategy_name(strategy);
        }
}

TEST(PathTracer, APictureOfAFurnaceIsItsClosedForm) {
    const Scene scene = make_builtin_scene("builtin:sphere:0.5");
    const Surface surface(scene);
    const Spotlight light = hard_spot(Vec3(0.0f, 0.1f, 0.2f), Vec3(0.0f, -1.0f, 0.0f), 50.0f);
    Camera camera{.position = Vec3::Zero(), .target = Vec3::UnitX(), .width = 32, .height = 32};
    camera.check();
    const double irradiance = flux(light) / (4.0 * pi);
    for (const auto& [layer, exact] : {std::pair(Layer::irradiance, irradiance),
                                       std::pair(Layer::indirect, irradiance * 0.5 / pi)}) {
        const PictureEstimate picture =
            render_reference(surface, light, camera, layer, {.target_error = 0.05, .seed = 9});
        EXPECT_LE(picture.relative_error, 0.05);
        const double mean =
            Eigen::ArrayXf::Map(picture.image.rgb.data(), 3 * 32 * 32).cast<double>().mean();
        expect_equal_within_noise(mean, exact, picture.relative_error * exact / 32.0,
                                  layer_name(layer));
    }
}

TEST(PathTracer, LayersHaveNames) {
    for (const Layer layer : {Layer::direct, Layer::indirect, Layer::full, Layer::irradiance})
        EXPECT_EQ(layer_from_name(layer_name(layer)), layer);
    EXPECT_THROW(layer_from_name("Indirect"), UsageError);
}

} // namespace
} // namespace afterglow
