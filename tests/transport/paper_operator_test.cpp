#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "tests/support/gather_oracle.h"
#include "tests/support/shepard_oracle.h"
#include "tests/support/surface_samples.h"
#include "transport/display.h"
#include "transport/paper_links.h"
#include "transport/paper_series.h"
#include "transport/precompute.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

// The operator as printed, against slow versions that read like the paper.

namespace afterglow {
namespace {

/// A built-in scene with a small hierarchy of the printed shape.
struct PaperExample {
    Scene scene;
    Surface surface;
    PointHierarchy points;
    int sender_levels;
    ShepardBasis basis;
    Pyramid pyramid;
    PullOperator pull;

    PaperExample(const std::string& name, float coarse_radius, int receiver_levels, int sender_levels_)
        : scene(make_builtin_scene(name)), surface(scene),
          points(make_points(surface, coarse_radius, receiver_levels)),
          sender_levels(sender_levels_), basis(points, surface, false),
          pyramid(make_pyramid(basis, sender_levels)),
          pull(make_point_pull(basis, sender_levels)) {}

    static PointHierarchy make_points(const Surface& surface, float coarse_radius, int levels) {
        CandidateSource source(surface, {*surface.scene().viewpoint}, 1);
        return build_hierarchy(source, {.coarse_radius = coarse_radius,
                                        .levels = levels,
                                        .shape = BasisShape::paper()});
    }

    RgbLinks links(float threshold, int rays, std::uint64_t seed = 1,
                   LinkStatistics* statistics = nullptr) const {
        LinkOptions options;
        options.rays = rays;
        options.threshold = threshold;
        options.seed = seed;
        LinkStatistics unused;
        return make_paper_links(surface, basis, sender_levels, options,
                                statistics ? *statistics : unused);
    }

    std::uint32_t senders() const { return points.end(sender_levels - 1); }
    int level_of(std::uint32_t i) const {
        int l = 0;
        while (i >= points.end(l)) ++l;
        return l;
    }
    /// B_k(x) of a level's functions, by the formula. Less than 10^-12 is a right angle, rounded.
    std::map<std::uint32_t, double> functions_of(int level, const SurfacePoint& x) const {
        std::map<std::uint32_t, double> all = shepard_by_formula(points, level, x, nullptr);
        std::erase_if(all, [](const auto& function) { return function.second < 1e-12; });
        return all;
    }
    /// Of all functions on levels [0, levels).
    std::map<std::uint32_t, double> functions(int levels, const SurfacePoint& x) const {
        std::map<std::uint32_t, double> all;
        for (int l = 0; l < levels; ++l)
            all.merge(functions_of(l, x));
        return all;
    }
};

using DenseRow = std::map<std::uint32_t, RgbLink>;

DenseRow row_of(const RgbLinks& links, std::uint32_t i) {
    DenseRow row;
    for (std::size_t e = 0; e < links.indices(i).size(); ++e)
        row[links.indices(i)[e]] = links.values(i)[e];
    return row;
}

/// Adds scale times a row.
void add(DenseRow& to, const DenseRow& row, double scale) {
    for (const auto& [j, link] : row)
        to.try_emplace(j, RgbLink::Zero()).first->second += static_cast<float>(scale) * link;
}

/// T' from links of which none were dropped: (17) the other way round.
std::vector<DenseRow> raw_links(const PaperExample& example, const RgbLinks& all) {
    std::vector<DenseRow> raw;
    for (std::uint32_t i = 0; i < example.points.size(); ++i) {
        raw.push_back(row_of(all, i));
        for (const auto& [k, share] : example.functions(example.level_of(i), example.points.point(i)))
            add(raw.back(), row_of(all, k), share);
    }
    return raw;
}

TEST(PaperLinks, AreTheIntegralOfWhatIsSeen) {
    // (16) by plain Monte Carlo with the basis by the formula, to random fields of the senders, at
    // receivers of all levels; eight seeds of the operator. Coloured walls.
    const PaperExample example("builtin:cornell", 0.25f, 3, 2);
    Rng random(5, 0);
    std::vector<float> field(example.senders());
    for (float& value : field)
        value = random.uniform();

    constexpr int seeds = 8, rays = 4000;
    std::vector<std::vector<DenseRow>> raw;
    for (int seed = 0; seed < seeds; ++seed)
        raw.push_back(raw_links(example, example.links(0.0f, 256, 100 + seed)));
    int compared = 0;
    double squares = 0.0;
    for (std::uint32_t i = 0; i < example.points.size(); i += 41) {
        Eigen::ArrayXXd found(9, seeds);
        for (int seed = 0; seed < seeds; ++seed) {
            found.col(seed).setZero();
            for (const auto& [j, link] : raw[seed][i])
                found.col(seed) += static_cast<double>(field[j]) * link.cast<double>();
        }
        const SurfacePoint x = example.points.point(i);
        const Frame frame(x.normal);
        Eigen::ArrayXXd expected(9, rays);
        parallel_for(rays, [&](Index k) {
            Rng rng(1000 + i, static_cast<std::uint64_t>(k));
            const float u = rng.uniform(), v = rng.uniform();
            const Vec3 direction = frame.to_world(sample_vector_irradiance({u, v}));
            const Hit hit = example.surface.closest_hit({example.surface.lifted(x), direction});
            expected.col(k).setZero();
            if (!hit) return;
            double seen = 0.0;
            for (const auto& [j, share] : example.functions(2, example.surface.point(hit)))
                seen += share * field[j];
            const double density = vector_irradiance_pdf(direction.dot(x.normal));
            const Rgb rho = example.surface.reflectance(hit);
            for (int axis = 0; axis < 3; ++axis)
                for (int c = 0; c < 3; ++c)
                    expected(3 * axis + c, k) = seen * rho[c] * direction[axis] / (EIGEN_PI * density);
        });
        const MeanAndError a = over_repetitions(found), b = over_repetitions(expected);
        for (int c = 0; c < 9; ++c) {
            const double z = (a.mean[c] - b.mean[c]) / std::hypot(a.error[c], b.error[c]);
            EXPECT_LT(std::abs(z), 5.5) << "receiver " << i << ", component " << c;
            squares += z * z;
            ++compared;
        }
    }
    ASSERT_GT(compared, 100);
    // The error of few seeds is itself uncertain: z has seven degrees of freedom at worst.
    EXPECT_LT(squares / compared, 1.6);
}

TEST(PaperLinks, AreRefinedAsFigureFiveSays) {
    const PaperExample example("builtin:cornell", 0.25f, 4, 2);
    const std::vector<DenseRow> raw = raw_links(example, example.links(0.0f, 64));
    std::vector<std::set<std::uint32_t>> neighbours(example.senders());
    for (std::uint32_t k = 0; k < example.senders(); ++k)
        for (const auto& [j, share] :
             example.functions_of(example.level_of(k), example.points.point(k)))
            if (j != k) neighbours[j].insert(k);

    for (const float threshold : {0.002f, 0.01f, 0.05f}) {
        LinkStatistics statistics;
        const RgbLinks links = example.links(threshold, 64, 1, &statistics);
        std::vector<DenseRow> expected(example.points.size());
        std::set<std::uint32_t> queue;
        for (std::uint32_t i = 0; i < example.points.end(0); ++i)
            queue.insert(i);
        for (std::uint32_t i = example.points.end(0); i < example.points.size(); ++i) {
            const int above = example.level_of(i) - 1;
            if (example.functions_of(above, example.points.point(i)).empty())
                queue.insert(i); // no parent would ever push it
        }
        std::uint64_t gathered = 0, undecided = 0, kept = 0;
        while (!queue.empty()) {
            const std::uint32_t i = *queue.begin(); // the front: ids rise from level to level
            queue.erase(queue.begin());
            ++gathered;
            const int level = example.level_of(i);
            DenseRow t = raw[i];
            // As stored: the operator's own, so that rounding does not tip a later decision.
            for (const auto& [k, share] : example.functions(level, example.points.point(i)))
                add(t, row_of(links, k), -share);
            const DenseRow stored = row_of(links, i);
            const auto link_to = [&](std::uint32_t j) {
                const auto found = t.find(j);
                return found == t.end() ? RgbLink(RgbLink::Zero()) : found->second;
            };
            for (const auto& [j, link] : t) {
                float decisive = magnitude(link);
                if (j >= example.points.end(0)) {
                    float variation = neighbours[j].empty() ? decisive : 0.0f;
                    for (const std::uint32_t k : neighbours[j])
                        variation = std::max(variation, magnitude(link - link_to(k)));
                    decisive = std::min(decisive, variation);
                }
                if (std::abs(decisive - threshold) < 1e-5f) {
                    ++undecided;
                    continue;
                }
                ASSERT_EQ(stored.contains(j), decisive > threshold) << i << " <- " << j;
                if (!stored.contains(j)) continue;
                ++kept;
                ASSERT_LT(magnitude(stored.at(j) - link), 1e-5f);
            }
            if (stored.empty() || level + 1 == example.points.levels()) continue;
            for (std::uint32_t c = example.points.begin(level + 1); c < example.points.end(level + 1); ++c)
                if (example.functions_of(level, example.points.point(c)).contains(i))
                    queue.insert(c);
        }
        EXPECT_EQ(statistics.rays, 64 * gathered) << threshold;
        EXPECT_GT(kept, 100u);
        EXPECT_LE(undecided, kept / 50 + 20);
        EXPECT_NEAR(static_cast<double>(links.entries()), static_cast<double>(kept),
                    static_cast<double>(undecided));
        if (threshold == 0.05f) {
            EXPECT_LT(gathered, example.points.size()) << "nothing was pruned";
        }
    }
}

/// S e from the definitions: T to all receivers once, then what the sum of it says at the senders is
/// dotted with their normals, pulled, analysed and sent to the coarsest receivers, again and again.
std::vector<RgbLink> bounce_by_bounce(const PaperExample& example, const RgbLinks& links,
                                      const std::vector<float>& coefficients, int bounces) {
    const PointHierarchy& points = example.points;
    std::vector<float> e = coefficients;
    std::vector<RgbLink> total(points.size(), RgbLink::Zero());
    for (int bounce = 1; bounce <= bounces; ++bounce) {
        const std::uint32_t receivers = bounce == 1 ? points.size() : points.end(0);
        std::vector<RgbLink> arrived(points.size(), RgbLink::Zero());
        for (std::uint32_t i = 0; i < receivers; ++i) {
            for (const auto& [j, link] : row_of(links, i))
                for (int k = 0; k < 9; ++k)
                    arrived[i][k] += link[k] * e[3 * j + k % 3];
            total[i] += arrived[i];
        }
        for (std::uint32_t m = 0; m < example.senders(); ++m) {
            std::fill_n(&e[3 * m], 3, 0.0f);
            for (const auto& [k, share] : example.functions(points.levels(), points.point(m)))
                for (int axis = 0; axis < 3; ++axis)
                    for (int c = 0; c < 3; ++c)
                        e[3 * m + c] += static_cast<float>(share) * points.normal(axis, m)
                                        * arrived[k][3 * axis + c];
        }
        example.pull.pull(points, example.sender_levels, 3, e);
        example.pyramid.analyse(points, example.sender_levels, 3, e);
    }
    return total;
}

TEST(PaperSeries, IsSeveralBouncesOneByOne) {
    const PaperExample example("builtin:cornell", 0.25f, 3, 2);
    const RgbLinks links = example.links(0.001f, 128);
    Rng random(9, 0);
    std::vector<float> e(3 * example.senders());
    for (float& value : e)
        value = random.uniform() - 0.3f;
    for (const int bounces : {1, 2, 4}) {
        const RgbLinks sum = make_paper_series(links, example.basis, 2, example.pyramid,
                                               example.pull, bounces, 0.0f);
        const std::vector<RgbLink> expected = bounce_by_bounce(example, links, e, bounces);
        double error = 0.0, size = 0.0;
        for (std::uint32_t i = 0; i < example.points.size(); ++i) {
            RgbLink found = RgbLink::Zero();
            for (const auto& [j, link] : row_of(sum, i))
                for (int k = 0; k < 9; ++k)
                    found[k] += link[k] * e[3 * j + k % 3];
            error += (found - expected[i]).square().sum();
            size += expected[i].square().sum();
        }
        EXPECT_LT(std::sqrt(error / size), 1e-4) << bounces << " bounces";
    }
}

TEST(PaperSeries, TruncatesWhatIsBelowTheThreshold) {
    const PaperExample example("builtin:cornell", 0.25f, 2, 2);
    const RgbLinks links = example.links(0.001f, 128);
    const RgbLinks exact =
        make_paper_series(links, example.basis, 2, example.pyramid, example.pull, 2, 0.0f);
    const RgbLinks cut =
        make_paper_series(links, example.basis, 2, example.pyramid, example.pull, 2, 0.01f);
    for (std::uint32_t i = 0; i < example.points.end(0); ++i) {
        const DenseRow stored = row_of(cut, i);
        for (const auto& [j, link] : row_of(exact, i)) {
            ASSERT_EQ(stored.contains(j), magnitude(link) > 0.01f);
            if (stored.contains(j)) {
                EXPECT_TRUE((stored.at(j) == link).all());
            }
        }
    }
    EXPECT_LT(cut.entries(), exact.entries());
}

PrecomputeOptions quick_paper() {
    PrecomputeOptions options = PrecomputeOptions::paper();
    options.receiver_levels = 4;
    options.links.rays = 128;
    return options;
}

TEST(PaperOperator, FillsAClosedRoomWithAsManyBouncesAsItHas) {
    // rho + rho^2 + rho^3 + rho^4 of the direct light, with a threshold below which little is left;
    // the light bounces as it falls, in one to four places of equal size, to the fineness of three
    // levels of senders.
    const Scene scene = make_builtin_scene("builtin:furnace:0.5");
    const Surface surface(scene);
    Spotlight light{.position = Vec3(0.2f, 0.7f, -0.1f),
                    .direction = Vec3(0.1f, -1.0f, 0.2f),
                    .inner_angle = 60.0f,
                    .outer_angle = 180.0f,
                    .intensity = Rgb::Constant(1.0f)};
    light.check();
    const std::vector<SurfacePoint> places = points_by_area(scene, 5'000, 3);
    for (const int bounces : {1, 4}) {
        PrecomputeOptions options = quick_paper();
        options.bounces = bounces;
        options.links.threshold = 1e-4f;
        const TransferOperator transfer = precompute(surface, options);
        const LightTransport transport(transfer, surface);
        const Display display(transfer, surface);
        const VectorIrradiance field = transport.indirect(light);
        double direct = 0.0, indirect = 0.0;
        for (const SurfacePoint& x : places) {
            bool covered = false;
            direct += direct_irradiance(surface, light, x)[0];
            indirect += display.net_irradiance(x, field, covered).max(0.0f)[0];
            EXPECT_TRUE(covered);
        }
        const double rho = 0.5, exact = rho * (1.0 - std::pow(rho, bounces)) / (1.0 - rho);
        EXPECT_NEAR(indirect / direct / exact, 1.0, 0.03) << bounces << " bounces";
    }
}

TEST(PaperOperator, LosesLightToItsThreshold) {
    // What our own thresholds are there to mend: most links of a scene are small, and all of them
    // are dropped.
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const Spotlight light{Vec3(0.278f, 0.5f, 0.2795f), -Vec3::UnitY(), 20.0f, 50.0f, Rgb(1, 1, 1)};
    const auto mean = [&](float threshold) {
        PrecomputeOptions options = quick_paper();
        options.links.threshold = threshold;
        const TransferOperator transfer = precompute(surface, options);
        const Display display(transfer, surface);
        const VectorIrradiance field = LightTransport(transfer, surface).indirect(light);
        double sum = 0.0;
        for (const SurfacePoint& x : points_by_area(scene, 1'000, 3)) {
            bool covered = false;
            sum += display.net_irradiance(x, field, covered).max(0.0f)[1];
        }
        return sum;
    };
    const double all = mean(1e-4f), some = mean(0.025f / 3.14159f);
    EXPECT_LT(some, 0.95 * all);
    EXPECT_GT(some, 0.3 * all);
}

TEST(PaperOperator, IsTheSameOnAnyNumberOfThreads) {
    const Scene scene = make_builtin_scene("builtin:cornell");
    const Surface surface(scene);
    const auto make = [&](int threads) {
        const ThreadLimit limit(threads);
        return precompute(surface, quick_paper());
    };
    const TransferOperator one = make(1), two = make(2);
    EXPECT_TRUE(std::ranges::equal(one.solution.index.span(), two.solution.index.span()));
    ASSERT_EQ(one.link_count(), two.link_count());
    for (std::size_t e = 0; e < one.link_count(); ++e)
        ASSERT_TRUE((one.solution.value[e] == two.solution.value[e]).all());
}

TEST(PaperOperator, RefusesImpossibleOptions) {
    const Scene scene = make_builtin_scene("builtin:furnace");
    const Surface surface(scene);
    const auto expect_refusal = [&](auto&& change) {
        PrecomputeOptions options = quick_paper();
        change(options);
        EXPECT_THROW(precompute(surface, options), UsageError);
    };
    expect_refusal([](auto& o) { o.sender_levels = 5; });
    expect_refusal([](auto& o) { o.bounces = 0; });
    expect_refusal([](auto& o) { o.links.threshold.reset(); });
}

} // namespace
} // namespace afterglow
