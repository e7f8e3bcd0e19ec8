#include "core/builtin_scenes.h"
#include "core/sampling.h"
#include "tests/support/surface_samples.h"
#include "transport/gather.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

namespace afterglow {
namespace {

using std::numbers::pi;

/// Receivers at given places; all that trace_gather() reads.
PointHierarchy receivers_at(const std::vector<SurfacePoint>& places) {
    PointHierarchy points;
    points.position.resize(3, static_cast<Index>(places.size()));
    points.normal.resize(3, static_cast<Index>(places.size()));
    for (std::size_t i = 0; i < places.size(); ++i) {
        points.position.col(static_cast<Index>(i)) = places[i].position;
        points.normal.col(static_cast<Index>(i)) = places[i].normal;
    }
    points.level_begin = {0, static_cast<std::uint32_t>(places.size())};
    points.spacing = {1.0f};
    return points;
}

/// All rays of the points [begin, end) of a level that begins with 0.
std::vector<GatherSample> gather(const Surface& surface, const SenderRows& rows, const PointHierarchy& points,
                                 std::uint32_t begin, std::uint32_t end, const GatherDirections& directions,
                                 const Footprint& footprint = {}) {
    std::vector<GatherSample> samples((end - begin) * static_cast<std::size_t>(directions.rays()));
    trace_gather(surface, rows, points, begin, 0, directions, footprint, samples);
    return samples;
}

TEST(GatherDirections, HaveTheDensityOfTheirWeights) {
    // Density (c + 1/2) / (2 pi): E c = 7/12, E c^2 = 5/12, E x^2 = E y^2 = 7/24, E x = E y = 0,
    // and the mean of 1 / density is the hemisphere, 2 pi. Each seed is one sample of the mean.
    constexpr int seeds = 400;
    const double exact[] = {7.0 / 12, 5.0 / 12, 7.0 / 24, 7.0 / 24, 0, 0, 0, 2 * pi};
    Eigen::ArrayXXd moments(8, seeds);
    Eigen::Matrix3Xf d;
    for (int s = 0; s < seeds; ++s) {
        const GatherDirections directions(16, static_cast<std::uint64_t>(s));
        directions.deal(s % 37, d);
        ASSERT_EQ(d.cols(), 16);
        Eigen::Array<double, 8, 1> sum = Eigen::Array<double, 8, 1>::Zero();
        for (Index k = 0; k < 16; ++k) {
            const Eigen::Vector3d w = d.col(k).cast<double>();
            EXPECT_NEAR(w.norm(), 1.0, 1e-5);
            Eigen::Array<double, 8, 1> m;
            m << w.z(), w.z() * w.z(), w.x() * w.x(), w.y() * w.y(), w.x(), w.y(), w.x() * w.y(),
                1.0 / vector_irradiance_pdf(d(2, k));
            sum += m;
        }
        moments.col(s) = sum / 16.0;
    }
    for (int m = 0; m < 8; ++m) {
        const double mean = moments.row(m).mean();
        const double error =
            std::sqrt((moments.row(m) - mean).square().sum() / (seeds * (seeds - 1.0)));
        EXPECT_NEAR(mean, exact[m], 4.0 * error) << "moment " << m;
        EXPECT_LT(error, 0.01);
    }
}

/// The point of the unit square that a direction came from; inverse of sample_vector_irradiance().
Eigen::Vector2d unit_square(const Vec3& d) {
    const double c = d.z();
    double turn = std::atan2(static_cast<double>(d.y()), static_cast<double>(d.x())) / (2.0 * pi);
    if (turn < 0.0) turn += 1.0;
    return {1.0 - 0.5 * (c * c + c), turn};
}

/// True where every elementary interval of area 1 / count holds one of the `count` points. Points
/// within rounding of a border may lie in either.
bool stratified(const std::vector<Eigen::Vector2d>& points) {
    const int count = static_cast<int>(points.size());
    for (int across = 1; across <= count; across *= 2) {
        const int up = count / across;
        std::set<std::pair<int, int>> taken;
        for (const Eigen::Vector2d& u : points) {
            const double x = u.x() * across, y = u.y() * up;
            const double rounding = 2e-6 * count;
            if (std::abs(x - std::round(x)) < rounding || std::abs(y - std::round(y)) < rounding)
                continue;
            if (!taken.insert({static_cast<int>(x), static_cast<int>(y)}).second) return false;
        }
        if (static_cast<int>(taken.size()) < count - count / 8) return false;
    }
    return true;
}

TEST(GatherDirections, StratifyEachReceiverAndItsNeighbours) {
    for (const int rays : {8, 16, 32, 64, 256}) {
        const GatherDirections directions(rays, 5);
        Eigen::Matrix3Xf d;
        std::vector<Eigen::Vector2d> pair, four;
        for (const Index receiver : {0, 1, 2, 3, 100, 101, 102, 103}) {
            directions.deal(receiver, d);
            std::vector<Eigen::Vector2d> single;
            for (Index k = 0; k < rays; ++k)
                single.push_back(unit_square(d.col(k)));
            EXPECT_TRUE(stratified(single)) << rays << " rays, receiver " << receiver;
            pair.insert(pair.end(), single.begin(), single.end());
            four.insert(four.end(), single.begin(), single.end());
            if (receiver % 2 == 1) {
                EXPECT_TRUE(stratified(pair)) << rays << " rays, up to receiver " << receiver;
                pair.clear();
            }
            if (receiver % 4 == 3) {
                EXPECT_TRUE(stratified(four)) << rays << " rays, up to receiver " << receiver;
                four.clear();
            }
        }
    }
}

/// Eight in a row share a cell of the square, an eighth of 1024 cells' sides each way.
TEST(GatherDirections, HaveNeighboursOfSimilarDirection) {
    const GatherDirections directions(1024, 3);
    Eigen::Matrix3Xf d;
    directions.deal(7, d);
    for (Index k = 0; k < d.cols(); k += 8) {
        Eigen::AlignedBox2d box;
        for (Index n = k; n < k + 8; ++n) box.extend(unit_square(d.col(n)));
        EXPECT_LT(box.sizes().x(), 1.0 / 8 + 1e-4) << k;
        EXPECT_LT(box.sizes().y(), 1.0 / 16 + 1e-4) << k;
    }
}

TEST(GatherDirections, DifferBetweenReceiversAndSeeds) {
    Eigen::Matrix3Xf a, b, c;
    const GatherDirections directions(64, 1);
    directions.deal(0, a);
    directions.deal(1, b);
    EXPECT_GT((a - b).cwiseAbs().maxCoeff(), 0.01f);
    GatherDirections(64, 2).deal(0, c);
    EXPECT_GT((a - c).cwiseAbs().maxCoeff(), 0.01f);
    directions.deal(0, c);
    EXPECT_EQ(a, c);
}

/// Some senders, so that rays have rows to name.
struct Senders {
    PointHierarchy points;
    ShepardBasis basis;
    SenderRows rows;

    Senders(const Surface& surface, const Vec3& viewpoint, float coarse_radius, int levels)
        : points(make_points(surface, viewpoint, coarse_radius, levels)),
          basis(points, surface, true), rows(surface, basis, levels) {}

    static PointHierarchy make_points(const Surface& surface, const Vec3& viewpoint,
                                      float coarse_radius, int levels) {
        CandidateSource source(surface, {viewpoint}, 1);
        HierarchyOptions options;
        options.coarse_radius = coarse_radius;
        options.levels = levels;
        return build_hierarchy(source, options);
    }
};

TEST(TraceGather, TurnsUniformRadiosityIntoTheNormal) {
    // (1 / pi) int_hemisphere omega d omega = n in a closed scene.
    const Scene scene = make_builtin_scene("builtin:two_rooms");
    const Surface surface(scene);
    Senders senders(surface, *scene.viewpoint, 1.0f, 1);
    const std::vector<SurfacePoint> places = points_by_area(scene, 256, 3);
    constexpr int rays = 256;
    const GatherDirections directions(rays, 7);
    const std::vector<GatherSample> samples =
        gather(surface, senders.rows, receivers_at(places), 0, 256, directions);
    ASSERT_EQ(samples.size(), 256u * rays);
    Eigen::Vector3d total_error = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < places.size(); ++i) {
        Vec3 sum = Vec3::Zero();
        for (int k = 0; k < rays; ++k) {
            const GatherSample& s = samples[i * rays + static_cast<std::size_t>(k)];
            ASSERT_NE(s.row, no_index);
            sum += s.weight;
        }
        // Of stratified directions; independent ones would be off by .05.
        EXPECT_LT((sum - places[i].normal).norm(), 0.03f);
        const Frame frame(places[i].normal);
        const Vec3 error = sum - places[i].normal;
        total_error += Eigen::Vector3d(frame.x.dot(error), frame.y.dot(error), frame.z.dot(error));
    }
    // All receivers together are one stratified set of 65536.
    EXPECT_LT(total_error.norm() / 256.0, 3e-4);
}

TEST(TraceGather, NamesTheRowsOfWhatItMeetsAtTheLevelOfItsFootprint) {
    // In the cube [-1, 1]^3 distance and cosine are known.
    const Scene scene = make_builtin_scene("builtin:furnace");
    const Surface surface(scene);
    Senders senders(surface, Vec3::Zero(), 0.8f, 4);
    const std::vector<SurfacePoint> places = points_by_area(scene, 64, 4);
    const Footprint footprint{.angle = 0.1f, .coarsest_spacing = 0.8f, .levels = 4};
    const GatherDirections directions(64, 7);
    const PointHierarchy points = receivers_at(places);
    // In two parts, as batches are traced.
    std::vector<GatherSample> samples;
    for (const std::uint32_t begin : {0u, 24u}) {
        const auto part =
            gather(surface, senders.rows, points, begin, begin == 0 ? 24 : 64, directions, footprint);
        samples.insert(samples.end(), part.begin(), part.end());
    }
    int finest = 0, between = 0;
    double chosen = 0.0, expected = 0.0; // how often the finer of two levels is taken
    for (std::size_t k = 0; k < samples.size(); ++k) {
        const SurfacePoint& x = places[k / 64];
        const GatherSample& s = samples[k];
        Vec3 sides = x.position.cwiseAbs();
        std::sort(sides.data(), sides.data() + 3);
        if (sides[1] > 0.99f) continue; // beside an edge the lift of the ray shows
        const Eigen::Vector3d d = s.weight.cast<double>().normalized();
        const double cosine = d.dot(x.normal.cast<double>());
        ASSERT_GT(cosine, 0.0);
        EXPECT_NEAR(s.weight.norm() * 64.0 * pi, 2.0 * pi / (cosine + 0.5), 1e-3);
        double t = 1e9;
        int axis = 0;
        for (int a = 0; a < 3; ++a) {
            const double to_wall = (std::copysign(1.0, d[a]) - x.position[a]) / d[a];
            if (to_wall > 1e-6 && to_wall < t) t = to_wall, axis = a;
        }
        const double size = 0.1 * t / std::max(std::abs(d[axis]), 0.3);
        const double exact = std::clamp(std::log2(0.8 / size), 0.0, 3.0);
        if (exact < 3.0 && std::abs(exact - std::round(exact)) < 1e-3) continue; // a close call
        const int coarser = static_cast<int>(exact);
        // A hit on the border of two patches may fall into either.
        const Vec3 direction = d.cast<float>();
        const Hit hit = surface.closest_hit({surface.lifted(x), direction});
        Hit beside[2] = {hit, hit};
        for (Hit& h : beside) {
            const float shift = &h == beside ? 1e-4f : -1e-4f;
            h.u += shift;
            h.v += 1.7f * shift;
        }
        const auto same_patch = [&](int l) {
            return senders.rows.number(beside[0], l) == senders.rows.number(beside[1], l);
        };
        if (coarser == 3) {
            if (same_patch(3)) {
                EXPECT_EQ(s.row, senders.rows.number(hit, 3));
            }
            ++finest;
        } else if (same_patch(coarser) && same_patch(coarser + 1)) {
            const bool finer = s.row == senders.rows.number(hit, coarser + 1);
            EXPECT_TRUE(finer || s.row == senders.rows.number(hit, coarser));
            chosen += finer;
            expected += exact - coarser;
            ++between;
        }
    }
    EXPECT_NEAR(chosen, expected, 2.0 * std::sqrt(0.25 * between)); // better than by chance
    EXPECT_GT(between, 1000);
    EXPECT_GT(finest, 100);
}

TEST(TraceGather, MarksRaysThatLeaveTheScene) {
    const Scene scene = make_corner(1.0f);
    const Surface surface(scene);
    Senders senders(surface, Vec3(0.3f, 0.3f, 0.0f), 0.3f, 1);
    const GatherDirections directions(64, 7);
    const SurfacePoint x{Vec3(0.5f, 0.0f, 0.0f), Vec3::UnitY()};
    const std::vector<GatherSample> samples = gather(surface, senders.rows, receivers_at({x}), 0, 1, directions);
    for (const GatherSample& s : samples) {
        // The wall x = 0 is one high and reaches from z = -1 to 1.
        const Vec3 at_wall = x.position + 0.5f / -s.weight.x() * s.weight;
        const bool meets =
            s.weight.x() < 0.0f && at_wall.y() < 1.0f && std::abs(at_wall.z()) < 1.0f;
        EXPECT_EQ(s.row != no_index, meets);
    }
}

} // namespace
} // namespace afterglow
