#include "core/builtin_scenes.h"
#include "core/parallel.h"
#include "core/sampling.h"
#include "tests/support/gather_oracle.h"
#include "tests/support/surface_samples.h"
#include "transport/links.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace afterglow {
namespace {

/// A built-in scene with a small basis over it.
struct LinksExample {
    Scene scene;
    Surface surface;
    PointHierarchy points;
    int sender_levels;
    ShepardBasis basis;
    PushOperator push;
    PullOperator pull;

    LinksExample(const std::string& name, float coarse_radius, int receiver_levels, int sender_levels_)
        : scene(make_builtin_scene(name)), surface(scene),
          points(make_points(surface, coarse_radius, receiver_levels)),
          sender_levels(sender_levels_), basis(points, surface, true),
          push(make_push_operator(basis)) {
        SenderRows rows(surface, basis, sender_levels);
        rows.see(arrivals(surface, points, 1));
        pull = rows.make_pull_operator();
    }

    static PointHierarchy make_points(const Surface& surface, float coarse_radius, int levels) {
        CandidateSource source(surface, {*surface.scene().viewpoint}, 1);
        HierarchyOptions options;
        options.coarse_radius = coarse_radius;
        options.levels = levels;
        return build_hierarchy(source, options);
    }

    Links links(const LinkOptions& options, float patch_share,
                LinkStatistics* statistics = nullptr) const {
        LinkStatistics unused;
        SenderRows rows(surface, basis, sender_levels, patch_share);
        return join_links(make_links(surface, points, push, pull, rows, options, statistics ? *statistics : unused));
    }

    std::uint32_t senders() const { return points.end(sender_levels - 1); }

    /// Vector irradiance at all receivers by sender coefficients: T, then push. 3 x receivers.
    Eigen::Matrix3Xd field(const Links& links, const Eigen::VectorXd& c) const {
        Eigen::Matrix3Xd v(3, points.size());
        for (Index i = 0; i < v.cols(); ++i) {
            Eigen::Vector3d sum = Eigen::Vector3d::Zero();
            links.for_each(i, [&](std::uint32_t j, const LinkVector& link) {
                sum += link.head<3>().cast<double>() * c[j];
            });
            for (std::size_t k = 0; k < push.parents.indices(i).size(); ++k)
                sum += push.parents.values(i)[k] * v.col(push.parents.indices(i)[k]);
            v.col(i) = sum;
        }
        return v;
    }

    /// Coefficients of sender values, from the definitions of push and update.
    Eigen::VectorXd coefficients(const Eigen::VectorXd& values) const {
        Eigen::VectorXd c = values;
        for (std::uint32_t i = 0; i < senders(); ++i)
            for (std::size_t k = 0; k < push.parents.indices(i).size(); ++k)
                c[i] -= push.parents.values(i)[k] * values[push.parents.indices(i)[k]];
        for (std::uint32_t k = points.begin(sender_levels - 1); k-- > 0;)
            for (std::size_t e = 0; e < pull.children.indices(k).size(); ++e)
                c[k] += pull.children.values(k)[e] * c[pull.children.indices(k)[e]];
        return c;
    }

    /// Standard error of field() along the normals by the rounding of links: that of a number
    /// rounded to a step, step / sqrt(12), in each, twice, as it is passed on to another.
    Eigen::VectorXd rounding(const Links& links, const Eigen::VectorXd& c) const {
        Eigen::VectorXd variance = Eigen::VectorXd::Zero(points.size());
        for (Index i = 0; i < variance.size(); ++i) {
            links.for_each(i, [&](std::uint32_t j, const LinkVector& link) {
                int exponent = 0;
                std::frexp(link.cwiseAbs().maxCoeff() / 7.5f, &exponent);
                variance[i] += std::pow(std::ldexp(c[j], exponent), 2) / 6.0;
            });
            for (std::size_t k = 0; k < push.parents.indices(i).size(); ++k)
                variance[i] += std::pow(push.parents.values(i)[k], 2)
                               * variance[push.parents.indices(i)[k]];
        }
        return variance.cwiseSqrt();
    }

    Eigen::VectorXd uniform() const {
        Eigen::VectorXd ones = Eigen::VectorXd::Zero(senders());
        ones.head(points.end(0)).setOnes();
        return ones;
    }
};

/// Counts how far two estimates are apart in standard errors. With many independent comparisons the
/// mean of z^2 is 1 and none is beyond five.
class Agreement {
public:
    void compare(double a, double error_a, double b, double error_b, const std::string& what) {
        const double error = std::hypot(error_a, error_b);
        if (!(error > 0.0)) return;
        const double z = (a - b) / error;
        EXPECT_LT(std::abs(z), 5.0)
            << what << ": " << a << " +- " << error_a << " against " << b << " +- " << error_b;
        ++count_;
        sum_ += z;
        squares_ += z * z;
    }
    int count() const { return count_; }
    double mean_square() const { return squares_ / count_; }
    double mean() const { return sum_ / count_; }

private:
    int count_ = 0;
    double sum_ = 0.0, squares_ = 0.0;
};

TEST(Links, AreThePlainGatherOfEachSender) {
    // The rows of the coarsest receivers, nothing dropped, from eight seeds, against plain Monte
    // Carlo: single senders and random fields. Patches so small that their size does not show.
    const LinksExample example("builtin:cornell", 0.25f, 1, 1);
    const std::uint32_t senders = example.senders();
    ASSERT_GT(senders, 20u);
    const Footprint footprint{0.05f, example.points.spacing[0], 1};
    Eigen::MatrixXd functionals = Eigen::MatrixXd::Identity(senders, senders + 8);
    Rng rng(5, 0);
    functionals.rightCols(8) = Eigen::MatrixXd::NullaryExpr(
        senders, 8, [&] { return static_cast<double>(rng.uniform()) - 0.3; });

    constexpr int seeds = 8;
    Eigen::MatrixXd rounding(example.points.size(), functionals.cols());
    std::vector<Eigen::ArrayXXd> measured(example.points.size(),
                                          Eigen::ArrayXXd::Zero(senders + 8, seeds));
    for (int seed = 0; seed < seeds; ++seed) {
        LinkOptions options;
        options.rays = 1024;
        options.threshold = 0.0f;
        options.seed = 100 + seed;
        const Links links = example.links(options, 0.03f);
        for (Index f = 0; f < functionals.cols(); ++f) {
            // That of one seed: where a link hardly varies, all are rounded alike.
            rounding.col(f) = example.rounding(links, functionals.col(f));
            const Eigen::Matrix3Xd v = example.field(links, functionals.col(f));
            for (std::uint32_t i = 0; i < example.points.size(); ++i)
                measured[i](f, seed) = v.col(i).dot(example.points.normal.col(i).cast<double>());
        }
    }
    Agreement single, fields;
    for (std::uint32_t i = 0; i < example.points.size(); i += 3) {
        const MeanAndError expected =
            irradiance_by_plain_gather(example.surface, example.basis, footprint,
                                       example.points.point(i), functionals, 20'000, 1000 + i);
        const MeanAndError found = over_repetitions(measured[i]);
        for (Index f = 0; f < functionals.cols(); ++f) {
            // Senders that hardly any ray meets have no normal distribution.
            if (f < senders && expected.mean[f] < 0.01) continue;
            (f < senders ? single : fields)
                .compare(found.mean[f], std::hypot(found.error[f], rounding(i, f)),
                         expected.mean[f], expected.error[f],
                         "receiver " + std::to_string(i) + ", functional " + std::to_string(f));
        }
    }
    EXPECT_GT(single.count(), 100);
    EXPECT_LT(std::abs(single.mean()), 4.0 / std::sqrt(single.count()));
    EXPECT_LT(std::abs(fields.mean()), 4.0 / std::sqrt(fields.count()));
    EXPECT_LT(single.mean_square(), 1.3);
    EXPECT_LT(fields.mean_square(), 1.8);
}

TEST(Links, OfEveryLevelAddUpToThePlainGather) {
    // Differenced, pushed and with three levels of senders, to smooth and rough sender values.
    const LinksExample example("builtin:cornell", 0.25f, 3, 2);
    const Footprint footprint{0.2f, example.points.spacing[0], 2};
    const std::uint32_t senders = example.senders();
    Eigen::MatrixXd values(senders, 6);
    Rng rng(6, 0);
    for (std::uint32_t j = 0; j < senders; ++j) {
        const Vec3 x = example.points.position.col(j);
        values.row(j) << 1.0, x.x(), x.y(), std::sin(20.0 * x.z()), rng.uniform(), rng.uniform();
    }
    constexpr int seeds = 8;
    Eigen::MatrixXd rounding(example.points.size(), 6);
    std::vector<Eigen::ArrayXXd> measured(example.points.size(), Eigen::ArrayXXd::Zero(6, seeds));
    for (int seed = 0; seed < seeds; ++seed) {
        LinkOptions options;
        options.rays = 256;
        options.threshold = 0.0f;
        options.footprint_angle = footprint.angle;
        options.seed = 200 + seed;
        const Links links = example.links(options, 0.03f);
        for (Index f = 0; f < 6; ++f) {
            const Eigen::VectorXd c = example.coefficients(values.col(f));
            rounding.col(f) = example.rounding(links, c);
            const Eigen::Matrix3Xd v = example.field(links, c);
            for (std::uint32_t i = 0; i < example.points.size(); ++i)
                measured[i](f, seed) = v.col(i).dot(example.points.normal.col(i).cast<double>());
        }
    }
    Agreement agreement;
    for (int level = 0; level < 3; ++level)
        for (std::uint32_t k = 0; k < 20; ++k) {
            const std::uint32_t count = example.points.end(level) - example.points.begin(level);
            const std::uint32_t i = example.points.begin(level) + k * count / 20;
            const MeanAndError expected =
                irradiance_by_plain_gather(example.surface, example.basis, footprint,
                                           example.points.point(i), values, 10'000, 2000 + i);
            const MeanAndError found = over_repetitions(measured[i]);
            for (Index f = 0; f < 6; ++f)
                agreement.compare(found.mean[f], std::hypot(found.error[f], rounding(i, f)),
                                  expected.mean[f], expected.error[f],
                                  "receiver " + std::to_string(i) + " on level "
                                      + std::to_string(level) + ", field " + std::to_string(f));
        }
    EXPECT_LT(std::abs(agreement.mean()), 0.3); // the six fields of a receiver share their rays
    EXPECT_LT(agreement.mean_square(), 1.5);
}

TEST(Links, AnswerUniformLightExactlyWhateverTheThreshold) {
    // In a closed room whose senders all carry radiosity 1 the vector irradiance is n.
    const LinksExample example("builtin:two_rooms", 1.0f, 4, 3);
    const Eigen::Matrix3Xd normals = example.points.normal.cast<double>();
    Eigen::Matrix3Xd unthresholded;
    for (const float threshold : {0.0f, 1e-3f, 4e-3f, 1.6e-2f}) {
        LinkOptions options;
        options.rays = 256;
        options.threshold = threshold;
        const Links links = example.links(options, 0.5f);
        const Eigen::Matrix3Xd v = example.field(links, example.uniform());
        const Eigen::ArrayXd irradiance = v.cwiseProduct(normals).colwise().sum().transpose();
        // Sampling: 256 stratified rays a receiver.
        EXPECT_NEAR(irradiance.mean(), 1.0, 2e-3) << "threshold " << threshold;
        EXPECT_LT(std::sqrt((irradiance - 1.0).square().mean()), 0.02);
        EXPECT_LT((irradiance - 1.0).abs().maxCoeff(), 0.1) << "threshold " << threshold;
        if (threshold == 0.0f) {
            unthresholded = v;
            continue;
        }
        const Eigen::ArrayXd change = (v - unthresholded).colwise().norm().transpose();
        // Exact but for the rounding of the last link of a row where any coarsest sender's link is
        // kept; where none is, what is dropped together is below the bound.
        const float bound = 4.0f * threshold; // on the finest level
        EXPECT_LT(change.mean(), 0.1f * bound + 5e-4f) << "threshold " << threshold;
        EXPECT_LT(change.maxCoeff(), bound + 3e-3f) << "threshold " << threshold;
    }
}

TEST(Links, BecomeFewerAndLessExactAsTheThresholdGrows) {
    const LinksExample example("builtin:cornell", 0.2f, 3, 2);
    Eigen::VectorXd values(example.senders());
    for (Index j = 0; j < values.size(); ++j)
        values[j] = example.points.position(1, j) > 0.3f ? 1.0 : 0.2;
    const Eigen::VectorXd coefficients = example.coefficients(values);
    LinkOptions options;
    options.rays = 256;
    options.threshold = 0.0f;
    LinkStatistics statistics;
    const Links all = example.links(options, 0.5f, &statistics);
    // All but differences that rounding alone has left: below 2^-32 nothing is stored.
    EXPECT_LE(all.count(0, all.rows()), statistics.links_before);
    EXPECT_GT(all.count(0, all.rows()), 0.999 * statistics.links_before);
    const Eigen::Matrix3Xd exact = example.field(all, coefficients);
    std::uint64_t last_count = all.count(0, all.rows());
    double last_error = 0.0;
    for (const float threshold : {8e-3f, 3.2e-2f, 1.28e-1f}) {
        options.threshold = threshold;
        const Links links = example.links(options, 0.5f);
        const double error = (example.field(links, coefficients) - exact).norm() / exact.norm();
        EXPECT_LT(links.count(0, links.rows()), 0.8 * last_count);
        EXPECT_GT(error, last_error);
        // The finest level drops what is below four thresholds; much of it cancels.
        EXPECT_LT(error, 8.0 * threshold);
        last_count = links.count(0, links.rows());
        last_error = error;
    }
}

TEST(Links, KeepEveryCoarseSenderThatTheCoarsestReceiversSee) {
    const LinksExample example("builtin:furnace", 0.8f, 2, 2);
    LinkOptions options;
    options.rays = 1024;
    options.threshold = 0.0f;
    const Links all = example.links(options, 0.5f);
    options.threshold = 0.1f;
    const Links kept = example.links(options, 0.5f);
    for (std::uint32_t i = 0; i < example.points.end(0); ++i) {
        std::size_t before = 0, after = 0;
        const auto coarsest = [&](std::size_t& count) {
            return [&](std::uint32_t j, const LinkVector&) { count += j < example.points.end(0); };
        };
        all.for_each(i, coarsest(before));
        kept.for_each(i, coarsest(after));
        EXPECT_EQ(before, after) << "receiver " << i;
        EXPECT_GT(after, 0u);
    }
}

TEST(Links, HaveSortedRowsOfSenders) {
    const LinksExample example("builtin:cornell", 0.2f, 3, 2);
    LinkOptions options;
    options.rays = 64;
    const Links links = example.links(options, 0.5f);
    ASSERT_EQ(links.rows(), example.points.size());
    for (Index i = 0; i < links.rows(); ++i) {
        std::int64_t before = -1;
        links.for_each(i, [&](std::uint32_t j, const LinkVector&) {
            EXPECT_LT(before, j);
            EXPECT_LT(j, example.senders());
            before = j;
        });
    }
}

TEST(Links, DependOnTheSeedButNotOnThreads) {
    const LinksExample example("builtin:cornell", 0.2f, 3, 2);
    const auto make = [&](int threads, std::uint64_t seed) {
        const ThreadLimit limit(threads);
        LinkOptions options;
        options.rays = 64;
        options.seed = seed;
        return example.links(options, 0.5f);
    };
    const auto equal = [](const Links& a, const Links& b) {
        return std::ranges::equal(a.begin.span(), b.begin.span())
               && std::ranges::equal(a.entry.span(), b.entry.span());
    };
    const Links one = make(1, 3);
    EXPECT_TRUE(equal(one, make(2, 3)));
    EXPECT_FALSE(equal(one, make(1, 4)));
}

} // namespace
} // namespace afterglow
