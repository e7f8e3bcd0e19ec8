#include "basis/nearest_points.h"

#include <nanoflann.hpp>

#include <algorithm>

namespace afterglow {

struct NearestPoints::Tree {
    struct Cloud {
        Eigen::Matrix3Xf points;
        std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(points.cols()); }
        float kdtree_get_pt(std::size_t i, std::size_t axis) const { return points(axis, i); }
        template <class Box>
        bool kdtree_get_bbox(Box&) const { return false; }
    };
    using Index3 = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud,
                                                       3, std::uint32_t>;
    Cloud cloud;
    Index3 index;
    explicit Tree(Eigen::Matrix3Xf points) : cloud{std::move(points)}, index(3, cloud, {16}) {}
};

NearestPoints::NearestPoints(Eigen::Matrix3Xf points)
    : tree_(std::make_unique<Tree>(std::move(points))) {}
NearestPoints::~NearestPoints() = default;

void NearestPoints::closest(const Vec3& x, int count, std::vector<std::uint32_t>& found) const {
    const auto n = std::min<std::size_t>(static_cast<std::size_t>(count),
                                         tree_->cloud.kdtree_get_point_count());
    found.resize(n);
    std::vector<float> distance2(n);
    if (n > 0) tree_->index.knnSearch(x.data(), n, found.data(), distance2.data());
}

} // namespace afterglow
