#pragma once

#include "core/types.h"

#include <array>
#include <bit>
#include <cassert>
#include <cmath>
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
    void containing(const Vec3& x, const Visit& visit) const {
        visit_near<false>(x, 0.0f, visit);
    }
    /// The same for each sphere that comes closer to x than `reach` [world].
    template <class Visit>
    void within(const Vec3& x, float reach, const Visit& visit) const {
        visit_near<true>(x, reach, visit);
    }

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

    template <bool grown, class Visit>
    void visit_near(const Vec3& x, float reach, const Visit& visit) const;
    /// Boxes that the cube of half-width `reach` about x touches.
    static unsigned near_mask(const Node& node, const Vec3& x, float reach);
    /// Spheres that contain x; `grown`: with radii longer by `reach`.
    template <bool grown>
    static unsigned near_mask(const Leaf& leaf, const Vec3& x, float reach,
                              std::array<float, width>& distance2);
};

#ifdef __AVX__
inline unsigned RTree::near_mask(const Node& node, const Vec3& x, float reach) {
    __m256 inside = _mm256_castsi256_ps(_mm256_set1_epi32(-1));
    for (int a = 0; a < 3; ++a) {
        const __m256 above = _mm256_set1_ps(x[a] + reach), below = _mm256_set1_ps(x[a] - reach);
        inside = _mm256_and_ps(inside, _mm256_cmp_ps(_mm256_load_ps(node.low[a].data()), above, _CMP_LE_OQ));
        inside = _mm256_and_ps(inside, _mm256_cmp_ps(below, _mm256_load_ps(node.high[a].data()), _CMP_LE_OQ));
    }
    return static_cast<unsigned>(_mm256_movemask_ps(inside));
}

template <bool grown>
unsigned RTree::near_mask(const Leaf& leaf, const Vec3& x, float reach,
                          std::array<float, width>& distance2) {
    __m256 sum = _mm256_setzero_ps();
    for (int a = 0; a < 3; ++a) {
        const __m256 d = _mm256_sub_ps(_mm256_set1_ps(x[a]), _mm256_load_ps(leaf.center[a].data()));
        sum = _mm256_add_ps(sum, _mm256_mul_ps(d, d));
    }
    _mm256_storeu_ps(distance2.data(), sum);
    __m256 radius2 = _mm256_load_ps(leaf.radius2.data());
    if constexpr (grown) {
        const __m256 radius = _mm256_add_ps(_mm256_sqrt_ps(radius2), _mm256_set1_ps(reach));
        radius2 = _mm256_mul_ps(radius, radius);
    }
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(sum, radius2, _CMP_LT_OQ)));
}
#else
inline unsigned RTree::near_mask(const Node& node, const Vec3& x, float reach) {
    unsigned mask = 0;
    for (int k = 0; k < width; ++k) {
        bool inside = true;
        for (int a = 0; a < 3; ++a) inside &= node.low[a][k] <= x[a] + reach && x[a] - reach <= node.high[a][k];
        mask |= static_cast<unsigned>(inside) << k;
    }
    return mask;
}

template <bool grown>
unsigned RTree::near_mask(const Leaf& leaf, const Vec3& x, float reach,
                          std::array<float, width>& distance2) {
    unsigned mask = 0;
    for (int k = 0; k < width; ++k) {
        float sum = 0.0f;
        for (int a = 0; a < 3; ++a) sum += (x[a] - leaf.center[a][k]) * (x[a] - leaf.center[a][k]);
        distance2[k] = sum;
        const float radius = grown ? std::sqrt(leaf.radius2[k]) + reach : 0.0f;
        mask |= static_cast<unsigned>(sum < (grown ? radius * radius : leaf.radius2[k])) << k;
    }
    return mask;
}
#endif

template <bool grown, class Visit>
void RTree::visit_near(const Vec3& x, float reach, const Visit& visit) const {
    if (nodes_.empty()) return;
    std::array<std::uint32_t, 128> stack; // a node pushes at most 8; 2^32 spheres are 11 levels deep
    int top = 0;
    stack[top++] = static_cast<std::uint32_t>(nodes_.size() - 1);
    while (top > 0) {
        const Node& node = nodes_[stack[--top]];
        for (unsigned mask = near_mask(node, x, reach); mask != 0; mask &= mask - 1) {
            const std::uint32_t child = node.first_child + static_cast<std::uint32_t>(std::countr_zero(mask));
            if (!node.above_leaves) {
                assert(top < static_cast<int>(stack.size()));
                stack[top++] = child;
                continue;
            }
            const Leaf& leaf = leaves_[child];
            std::array<float, width> distance2;
            for (unsigned in = near_mask<grown>(leaf, x, reach, distance2); in != 0; in &= in - 1) {
                const int k = std::countr_zero(in);
                visit(leaf.id[k], distance2[k]);
            }
        }
    }
}

} // namespace afterglow
