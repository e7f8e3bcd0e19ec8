#include "basis/r_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

namespace afterglow {
namespace {

/// Orders ids so that runs of `leaf` consecutive ones are compact tiles (Leutenegger et al. 1997):
/// slabs along x, strips along y, runs along z.
void tile(std::span<std::uint32_t> ids, const Eigen::Ref<const Eigen::Matrix3Xf>& centers, int leaf,
          int axis) {
    std::sort(ids.begin(), ids.end(), [&](std::uint32_t a, std::uint32_t b) {
        const float ca = centers(axis, a), cb = centers(axis, b);
        return ca != cb ? ca < cb : a < b;
    });
    if (axis == 2) return;
    const double tiles = std::ceil(static_cast<double>(ids.size()) / leaf);
    const auto slabs = static_cast<std::size_t>(std::ceil(std::pow(tiles, 1.0 / (3 - axis))));
    const std::size_t per_slab
        = static_cast<std::size_t>(std::ceil(tiles / static_cast<double>(slabs))) * leaf;
    for (std::size_t begin = 0; begin < ids.size(); begin += per_slab)
        tile(ids.subspan(begin, std::min(per_slab, ids.size() - begin)), centers, leaf, axis + 1);
}

} // namespace

RTree::RTree(const Eigen::Ref<const Eigen::Matrix3Xf>& centers,
             const Eigen::Ref<const Eigen::VectorXf>& radii, std::uint32_t first_id) {
    const auto count = static_cast<std::size_t>(centers.cols());
    if (count == 0) return;
    std::vector<std::uint32_t> order(count);
    std::iota(order.begin(), order.end(), 0u);
    tile(order, centers, width, 0);

    struct Box {
        Vec3 low, high;
    };
    constexpr float infinity = std::numeric_limits<float>::infinity();
    std::vector<Box> boxes;
    for (std::size_t begin = 0; begin < count; begin += width) {
        Leaf leaf{};
        leaf.radius2.fill(-1.0f); // an empty place contains nothing
        Box box{Vec3::Constant(infinity), Vec3::Constant(-infinity)};
        for (std::size_t k = 0; k < std::min<std::size_t>(width, count - begin); ++k) {
            const std::uint32_t i = order[begin + k];
            for (int a = 0; a < 3; ++a) leaf.center[a][k] = centers(a, i);
            leaf.radius2[k] = radii[i] * radii[i];
            leaf.id[k] = first_id + i;
            box.low = box.low.cwiseMin(Vec3(centers.col(i).array() - radii[i]));
            box.high = box.high.cwiseMax(Vec3(centers.col(i).array() + radii[i]));
        }
        leaves_.push_back(leaf);
        boxes.push_back(box);
    }

    // Level by level, eight consecutive children a node, until one is left.
    std::uint32_t first_child = 0;
    for (bool above_leaves = true; above_leaves || boxes.size() > 1; above_leaves = false) {
        const auto level_begin = static_cast<std::uint32_t>(nodes_.size());
        std::vector<Box> parents;
        for (std::size_t begin = 0; begin < boxes.size(); begin += width) {
            Node node;
            node.first_child = first_child + static_cast<std::uint32_t>(begin);
            node.above_leaves = above_leaves;
            Box box{Vec3::Constant(infinity), Vec3::Constant(-infinity)};
            for (int k = 0; k < width; ++k) {
                const bool used = begin + k < boxes.size();
                for (int a = 0; a < 3; ++a) {
                    node.low[a][k] = used ? boxes[begin + k].low[a] : infinity;
                    node.high[a][k] = used ? boxes[begin + k].high[a] : -infinity;
                }
                if (used) {
                    box.low = box.low.cwiseMin(boxes[begin + k].low);
                    box.high = box.high.cwiseMax(boxes[begin + k].high);
                }
            }
            nodes_.push_back(node);
            parents.push_back(box);
        }
        boxes = std::move(parents);
        first_child = level_begin;
    }
}

} // namespace afterglow
