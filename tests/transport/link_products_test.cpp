#include "transport/link_products.h"

#include "core/sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace afterglow {
namespace {

constexpr std::uint32_t sender_count = 30000;

/// Rows of 0 to 40 links, some of them far apart; the last row ends with the array.
Links random_rows() {
    Rng rng(8, 0);
    std::vector<std::uint64_t> begin = {0};
    std::vector<PackedLink> all, row;
    LinkPacker packer;
    for (int i = 0; i < 200; ++i) {
        row.clear();
        const std::uint32_t farthest = i % 3 == 0 ? 5000 : 100;
        std::uint32_t sender = rng.next() % 300;
        for (int k = 0; k < i % 41 && sender < sender_count; ++k) {
            const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
            packer.append(sender, std::exp2(-20.0f * rng.uniform()) * LinkVector(x - 0.5f, y - 0.5f, z - 0.5f, 0.0f), row);
            sender += 1 + rng.next() % farthest;
        }
        all.insert(all.end(), row.begin(), row.end());
        begin.push_back(all.size());
    }
    return {SharedArray(std::move(begin)), SharedArray(std::move(all))};
}

TEST(LinkProducts, OfRowsAreSumsOverTheirLinks) {
    const Links links = random_rows();
    Rng rng(9, 0);
    std::vector<float> coefficients(4 * sender_count);
    for (float& c : coefficients) c = rng.uniform() - 0.3f;
    for (Index i = 0; i < links.rows(); ++i) {
        Eigen::Matrix<double, 4, 3> expected = Eigen::Matrix<double, 4, 3>::Zero();
        double size = 0.0;
        links.for_each(i, [&](std::uint32_t j, const LinkVector& link) {
            const Eigen::Vector4d c = Eigen::Vector4f::Map(&coefficients[4 * j]).cast<double>();
            expected += c * link.head<3>().cast<double>().transpose();
            size += c.norm() * static_cast<double>(link.norm());
        });
        const LinkProduct product = multiply_row(links, i, coefficients.data());
        for (int a = 0; a < 3; ++a)
            for (int c = 0; c < 4; ++c)
                ASSERT_NEAR(product[static_cast<std::size_t>(4 * a + c)], expected(c, a), 1e-6 * size) << "row " << i;
    }
}

TEST(LinkProducts, RowsAreSoundWhereTheirSendersRiseAndAreThere) {
    const Links links = random_rows();
    for (Index i = 0; i < links.rows(); ++i) {
        std::uint32_t needed = 0;
        for (const PackedLink& packed : links.row(i)) needed += Links::step_of(Links::bits_of(packed));
        EXPECT_TRUE(is_sound_row(links, i, needed)) << i;
        if (needed == 0) continue;
        EXPECT_FALSE(is_sound_row(links, i, needed - 1)) << i;
        for (std::size_t k = 0; k < links.row(i).size(); ++k) { // a step of zero
            std::vector<PackedLink> row(links.row(i).begin(), links.row(i).end());
            row[k][0] &= 0x80;
            if (Links::is_jump(Links::bits_of(row[k]))) row[k] = {};
            std::vector<std::uint64_t> begin = {0, row.size()};
            EXPECT_FALSE(is_sound_row({SharedArray(std::move(begin)), SharedArray(std::move(row))}, 0, sender_count)) << i;
        }
    }
}

TEST(LinkProducts, OfAColumnGoToItsReceiversAlone) {
    Rng rng(10, 0);
    const Eigen::Vector4f coefficient(0.3f, -2.0f, 0.7f, 0.0f);
    for (std::size_t count = 0; count < 20; ++count) {
        std::vector<ColumnLink> column;
        Eigen::Matrix<float, 12, Eigen::Dynamic> expected = Eigen::Matrix<float, 12, Eigen::Dynamic>::Ones(12, 60);
        std::vector<PackedLink> row;
        LinkPacker packer;
        for (std::size_t k = 0; k < count; ++k) {
            const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
            row.clear();
            const LinkVector link = packer.append(0, {x - 0.5f, y - 0.5f, z - 0.5f, 0.0f}, row);
            const auto receiver = static_cast<Index>(1 + 2 * k);
            column.push_back(ColumnLink::pack(receiver, Links::bits_of(row.at(0))));
            EXPECT_EQ(column.back().receiver(), receiver);
            EXPECT_EQ(column.back().vector(), link);
            for (int a = 0; a < 3; ++a) expected.col(receiver).segment<4>(4 * a) += link[a] * coefficient;
        }
        Eigen::Matrix<float, 12, Eigen::Dynamic> products = Eigen::Matrix<float, 12, Eigen::Dynamic>::Ones(12, 60);
        add_column(column, coefficient.data(), products.data());
        EXPECT_LT((products - expected).cwiseAbs().maxCoeff(), 1e-6f) << count << " links";
    }
}

} // namespace
} // namespace afterglow
