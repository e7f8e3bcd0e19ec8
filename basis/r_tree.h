#pragma once

#include "core/types.h"

#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <vector>

#ifdef __AVX__
#include <immintrin.h>
#endif

namespace afterglow {

/// Finds the spheres that contain a point: a packed R-tree [Guttman 1984; LZT08, sec. 2.1] of eight
/// children a node, built by Sort-Tile-Recursive packing, with boxes and leaves in
/// structure-of-arrays order so that eight are tested at once.
/// Immutable once built; queries may run concurrently.
class RTree {
public:
    static constexpr int width = 8;

    RTree() = default;
    /// centers: 3 x N [world], radii: N. Sphere i is reported as first_id + i.
    RTree(const Eigen::Ref<const Eigen::Matrix3Xf>& centers, const Eigen::Ref<const Eigen::VectorXf>& radii,
          std::uint32_t first_id);

    /// Calls visit(id, squared distance to the centre) for each sphere that contains x. The order is fixed by the tree.
    template <class Visit>
    void containing(const Vec3& x, const Visit& visit) const;

    std::size_t node_count() const { return nodes_.size(); }
    std::size_t bytes() const { return nodes_.size() * sizeof(Node) + leaves_.size() * sizeof(Leaf); }

private:
    struct alignas(32) Node {
        std::array<float, width> low[3], high[3];
        std::uint32_t first_child = 0; // children are consecutive nodes, or leaves
        bool above_leaves = false;
    };
    struct alignas(32) Leaf {
        std::array<float, width> center[3], radius2;
        std::array<std::uint32_t, width> id;
    };
    std::vector<Node> nodes_; // root last
    std::vector<Leaf> leaves_;

    static unsigned inside_mask(const Node& node, const Vec3& x);
    static unsigned inside_mask(const Leaf& leaf, const Vec3& x, std::array<float, width>& distance2);
};

#ifdef __AVX__
inline unsigned RTree::inside_mask(const Node& node, const Vec3& x) {
    __m256 inside = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
    for (int a = 0; a < 3; ++a) {
        const __m256 p = _mm256_set1_ps(x[a]);
        inside = _mm256_and_ps(inside, _mm256_cmp_ps(_mm256_load_ps(node.low[a].data()), p, _CMP_LE_OQ));
        inside = _mm256_and_ps(inside, _mm256_cmp_ps(p, _mm256_load_ps(node.high[a].data()), _CMP_LE_OQ));
    }
    return static_cast<unsigned>(_mm256_movemask_ps(inside));
}

inline unsigned RTree::inside_mask(const Leaf& leaf, const Vec3& x,
                                   std::array<float, width>& distance2) {
    __m256 sum = _mm256_setzero_ps();
    for (int a = 0; a < 3; ++a) {
        const __m256 d = _mm256_sub_ps(_mm256_set1_ps(x[a]), _mm256_load_ps(leaf.center[a].data()));
        sum = _mm256_add_ps(sum, _mm256_mul_ps(d, d));
    }
    _mm256_storeu_ps(distance2.data(), sum);
    return static_cast<unsigned>(_mm256_movemask_ps(
        _mm256_cmp_ps(sum, _mm256_load_ps(leaf.radius2.data()), _CMP_LT_OQ)));
}
#else
inline unsigned RTree::inside_mask(const Node& node, const Vec3& x) {
    unsigned mask = 0;
    for (int k = 0; k < width; ++k) {
        bool inside = true;
        for (int a = 0; a < 3; ++a) inside &= node.low[a][k] <= x[a] && x[a] <= node.high[a][k];
        mask |= static_cast<unsigned>(inside) << k;
    }
    return mask;
}

inline unsigned RTree::inside_mask(const Leaf& leaf, const Vec3& x,
                                   std::array<float, width>& distance2) {
    unsigned mask = 0;
    for (int k = 0; k < width; ++k) {
        float sum = 0.0f;
        for (int a = 0; a < 3; ++a) sum += (x[a] - leaf.center[a][k]) * (x[a] - leaf.center[a][k]);
        distance2[k] = sum;
        mask |= static_cast<unsigned>(sum < leaf.radius2[k]) << k;
    }
    return mask;
}
#endif

template <class Visit>
void RTree::containing(const Vec3& x, const Visit& visit) const {
    if (nodes_.empty()) return;
    std::array<std::uint32_t, 128> stack; // a node pushes at most 8; 2^32 spheres are 11 levels deep
    int top = 0;
    stack[top++] = static_cast<std::uint32_t>(nodes_.size() - 1);
    while (top > 0) {
        const Node& node = nodes_[stack[--top]];
        for (unsigned mask = inside_mask(node, x); mask != 0; mask &= mask - 1) {
            const std::uint32_t child = node.first_child + static_cast<std::uint32_t>(std::countr_zero(mask));
            if (!node.above_leaves) {
                assert(top < static_cast<int>(stack.size()));
                stack[top++] = child;
                continue;
            }
            const Leaf& leaf = leaves_[child];
            std::array<float, width> distance2;
            for (unsigned in = inside_mask(leaf, x, distance2); in != 0; in &= in - 1) {
                const int k = std::countr_zero(in);
                visit(leaf.id[k], distance2[k]);
            }
        }
    }
}

} // namespace afterglow
