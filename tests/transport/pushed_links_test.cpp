#include "core/sampling.h"
#include "transport/pushed_links.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace afterglow {
namespace {

TEST(PushedLinks, AreReadAsTheyWereWrittenButForRounding) {
    Rng rng(3, 0);
    std::map<std::uint32_t, LinkVector> links;
    PushedLinkPacker packer;
    for (int row_number = 0; row_number < 20; ++row_number) { // one packer for all
        links.clear();
        std::vector<PushedLink> row;
        std::uint32_t sender = row_number % 2 == 0 ? 0 : 70'000;
        for (int k = 0; k < 200; ++k, sender += 1 + rng.next() % (k % 20 == 0 ? 200'000 : 100)) {
            const float size = std::exp2(3.0f - 36.0f * rng.uniform());
            const float x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
            links[sender] = size * LinkVector(x - 0.5f, 2.0f * y - 1.0f, z, 0.0f);
            packer.append(sender, links[sender], row);
        }
        std::size_t found = 0;
        for_each_pushed(row, [&](std::uint32_t j, const LinkVector& value) {
            EXPECT_EQ(value[3], 0.0f);
            if (!links.contains(j)) {
                EXPECT_TRUE(value.isZero(0.0f)); // on the way to one far off
                return;
            }
            ++found;
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(value[c], links[j][c], std::max(std::ldexp(std::abs(links[j][c]), -11), std::ldexp(1.0f, -38)));
        });
        EXPECT_EQ(found, links.size());
    }
}

TEST(PushedLinks, ARowMayBeEmpty) {
    for_each_pushed({}, [](std::uint32_t, const LinkVector&) { FAIL(); });
}

} // namespace
} // namespace afterglow
