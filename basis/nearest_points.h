#pragma once

#include "core/types.h"

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <vector>

namespace afterglow {

/// The closest of a fixed set of points, by a k-d tree. Immutable; queries may run concurrently.
class NearestPoints {
public:
    /// points: 3 x N, world space; copied.
    explicit NearestPoints(Eigen::Matrix3Xf points);
    ~NearestPoints();

    /// Replaces `found` with the ids of the `count` closest points (or all, if fewer), by distance.
    void closest(const Vec3& x, int count, std::vector<std::uint32_t>& found) const;

private:
    struct Tree;
    std::unique_ptr<const Tree> tree_; // the k-d tree library is seen by the .cpp alone
};

} // namespace afterglow
