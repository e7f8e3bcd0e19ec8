#include "transport/link_columns.h"

#include "core/sampling.h"

#include <gtest/gtest.h>

#include <cmath>

namespace afterglow {
namespace {

constexpr Index receivers = 20000, senders = 500; // three blocks of receivers

/// Rows of a few random links; some rows and some columns are empty.
Links random_links() {
    Rng rng(5, 0);
    std::vector<std::uint64_t> begin = {0};
    std::vector<PackedLink> all, row;
    LinkPacker packer;
    for (Index i = 0; i < receivers; ++i) {
        row.clear();
        if (i % 7 != 0)
            for (std::uint32_t j = rng.next() % 40; j < senders - 1; j += 1 + rng.next() % 80) {
                const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
                packer.append(j, std::exp2(-20.0f * rng.uniform()) * LinkVector(x - 0.5f, y - 0.5f, z - 0.5f, 0.0f), row);
            }
        all.insert(all.end(), row.begin(), row.end());
        begin.push_back(all.size());
    }
    return {SharedArray(std::move(begin)), SharedArray(std::move(all))};
}

TEST(LinkColumns, MultiplyAsRowsDo) {
    const Links links = random_links();
    const LinkColumns columns(links, senders, 0, receivers);
    EXPECT_EQ(columns.links(), links.count(0, receivers));

    Rng rng(6, 0);
    std::vector<LinkColumns::Change> changes;
    std::vector<Eigen::Vector4f> coefficient(senders, Eigen::Vector4f::Zero());
    for (std::uint32_t j = 0; j < senders; j += 3) {
        const float r = rng.uniform(), g = rng.uniform(), b = rng.uniform();
        coefficient[j] = {r - 0.5f, g, b, 0.0f};
        changes.push_back({j, coefficient[j]});
    }
    std::vector<Eigen::Vector4f> product(3 * receivers, Eigen::Vector4f::Ones());
    for (Index block = 0; block < columns.blocks(); ++block) columns.add_product(block, changes, product);
    for (Index i = 0; i < receivers; ++i) {
        Eigen::Matrix<double, 4, 3> expected = Eigen::Matrix<double, 4, 3>::Ones();
        links.for_each(i, [&](std::uint32_t j, const LinkVector& link) {
            expected += coefficient[j].cast<double>() * link.head<3>().cast<double>().transpose();
        });
        for (int a = 0; a < 3; ++a)
            ASSERT_LT((product[static_cast<std::size_t>(3 * i + a)].cast<double>() - expected.col(a)).cwiseAbs().maxCoeff(), 1e-5)
                << "receiver " << i;
    }
}

TEST(LinkColumns, KnowTheirNormsAndLengths) {
    const Links links = random_links();
    const LinkColumns columns(links, senders, 0, receivers);
    std::vector<float> weights(receivers);
    for (Index i = 0; i < receivers; ++i) weights[static_cast<std::size_t>(i)] = static_cast<float>(1 + i % 4);
    std::vector<double> expected(senders);
    std::vector<std::uint32_t> count(senders);
    for (Index i = 0; i < receivers; ++i)
        links.for_each(i, [&](std::uint32_t j, const LinkVector& link) {
            expected[j] += weights[static_cast<std::size_t>(i)] * static_cast<double>(link.squaredNorm());
            ++count[j];
        });
    const std::vector<float> norms = columns.norms(weights);
    for (std::uint32_t j = 0; j < senders; ++j) {
        EXPECT_NEAR(norms[j], std::sqrt(expected[j]), 1e-5 * std::sqrt(expected[j]));
        EXPECT_EQ(columns.links_of(j), count[j]);
    }
}

} // namespace
} // namespace afterglow
