#include "core/sampling.h"
#include "transport/packed_links.h"

#include <gtest/gtest.h>

#include <utility>

namespace afterglow {
namespace {

using Row = std::vector<std::pair<std::uint32_t, LinkVector>>;

Links links_of(std::vector<PackedLink> row) {
    std::vector<std::uint64_t> begin{0, row.size()};
    return {SharedArray(std::move(begin)), SharedArray(std::move(row))};
}

Row read(const Links& links) {
    Row row;
    links.for_each(0, [&](std::uint32_t sender, const LinkVector& v) { row.push_back({sender, v}); });
    return row;
}

TEST(PackedLinks, AreReadAsTheyWereWritten) {
    LinkPacker packer;
    Rng rng(1, 0);
    for (int repetition = 0; repetition < 100; ++repetition) {
        std::vector<PackedLink> packed;
        Row written;
        std::uint32_t sender = static_cast<std::uint32_t>(rng.uniform() * 300.0f);
        for (int k = 0; k < 50; ++k) {
            const LinkVector value = std::exp2(-30.0f * rng.uniform())
                                     * LinkVector(rng.uniform() - 0.5f, rng.uniform() - 0.5f,
                                                  rng.uniform() - 0.5f, 0.0f);
            const LinkVector stored = packer.append(sender, value, packed);
            // Half a step in each component; the largest is at least 3.75 steps.
            const float largest = value.cwiseAbs().maxCoeff();
            ASSERT_LE((stored - value).cwiseAbs().maxCoeff(), std::max(0.5f / 3.75f * largest, 0x1p-32f));
            if (!stored.isZero(0.0f)) written.push_back({sender, stored});
            sender += 1 + static_cast<std::uint32_t>(std::exp2(18.0f * rng.uniform()) - 1.0f);
        }
        const Links links = links_of(packed);
        ASSERT_EQ(read(links), written);
        EXPECT_EQ(links.count(0, 1), written.size());
    }
}

TEST(PackedLinks, RoundToTheNearestOfFifteenSteps) {
    LinkPacker packer;
    std::vector<PackedLink> row;
    EXPECT_EQ(packer.append(0, {0.875f, -0.3f, 0.0624f, 0.0f}, row),
              LinkVector(0.875f, -0.25f, 0.0f, 0.0f));
    EXPECT_EQ(packer.append(1, {0.94f, 0.0f, 0.0f, 0.0f}, row), LinkVector(1.0f, 0.0f, 0.0f, 0.0f));
    EXPECT_EQ(packer.append(2, {0.0f, 0x1p-31f, 0.0f, 0.0f}, row),
              LinkVector(0.0f, 0x1p-31f, 0.0f, 0.0f));
    EXPECT_EQ(row.size(), 3u);
    EXPECT_TRUE(packer.append(3, {0.0f, 0x1p-33f, 0.0f, 0.0f}, row).isZero(0.0f));
    EXPECT_TRUE(packer.append(3, LinkVector::Zero(), row).isZero(0.0f));
    EXPECT_EQ(row.size(), 3u);
    EXPECT_EQ(packer.append(4, {-100.0f, 0.0f, 0.0f, 0.0f}, row),
              LinkVector(-7.0f, 0.0f, 0.0f, 0.0f)); // more than any link can be
}

TEST(PackedLinks, TakeThreeBytesAndAJumpWhereSendersAreFarApart) {
    LinkPacker packer;
    const LinkVector one(1.0f, 0.0f, 0.0f, 0.0f);
    // From -1: a step of 127 needs no jump, one of 128 does; a jump reaches 4095.
    for (const auto& [sender, entries] : {std::pair{0u, 1u}, {126u, 1u}, {127u, 2u}, {4094u, 2u},
                                          {4095u, 2u}, {4221u, 2u}, {4222u, 3u}, {70000u, 19u}}) {
        std::vector<PackedLink> row;
        packer.append(sender, one, row);
        EXPECT_EQ(row.size(), entries) << "sender " << sender;
        EXPECT_EQ(read(links_of(row)), (Row{{sender, one}}));
    }
}

TEST(PackedLinks, StartAgainInEveryRow) {
    LinkPacker packer;
    const LinkVector one(0.0f, 1.0f, 0.0f, 0.0f);
    std::vector<PackedLink> first, second;
    packer.append(1000, one, first);
    packer.append(3, one, second);
    EXPECT_EQ(read(links_of(second)), (Row{{3, one}}));
}

} // namespace
} // namespace afterglow
