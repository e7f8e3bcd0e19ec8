#include "core/polygon.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cassert>

namespace afterglow {
namespace {

using Point = Eigen::Vector2d;

/// Twice the signed area of a triangle.
double turn(const Point& a, const Point& b, const Point& c) {
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// The corners seen along the polygon's own normal (Newell's, which exists for concave and slightly
/// bent polygons), so that it runs counter-clockwise.
std::vector<Point> flatten(std::span<const Vec3> corner) {
    const Eigen::Vector3d origin = corner[0].cast<double>();
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < corner.size(); ++i)
        normal += (corner[i].cast<double>() - origin)
                      .cross(corner[(i + 1) % corner.size()].cast<double>() - origin);
    int axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double side = normal[axis] < 0.0 ? -1.0 : 1.0;
    std::vector<Point> flat(corner.size());
    for (std::size_t i = 0; i < corner.size(); ++i) {
        const Eigen::Vector3d p = corner[i].cast<double>() - origin;
        flat[i] = {side * p[u], p[v]};
    }
    return flat;
}

/// The polygon that is left while ears are cut off it: a ring of corners.
class EarClipper {
public:
    explicit EarClipper(std::vector<Point> point)
        : point_(std::move(point)), next_(point_.size()), previous_(point_.size()) {
        const auto n = static_cast<std::uint32_t>(point_.size());
        for (std::uint32_t i = 0; i < n; ++i) {
            next_[i] = (i + 1) % n;
            previous_[i] = (i + n - 1) % n;
        }
        // Enough for any sensible face; a monstrous one must not take quadratic time and more.
        tests_left_ = 8 * point_.size() * std::min<std::size_t>(point_.size(), 256);
        refusals_left_ = point_.size() * std::min<std::size_t>(point_.size(), 512);
    }

    void clip(std::vector<std::array<std::uint32_t, 3>>& triangles) {
        std::uint32_t at = 0;
        std::size_t left = point_.size(), refused = 0;
        while (left > 3) {
            // Once all corners were refused the polygon crosses itself: any cut is as good as
            // another.
            if (refused < left && refusals_left_ > 0 && !is_ear(at)) {
                at = next_[at];
                ++refused;
                --refusals_left_;
                continue;
            }
            const std::uint32_t before = previous_[at], after = next_[at];
            triangles.push_back({before, at, after});
            next_[before] = after;
            previous_[after] = before;
            --left;
            refused = 0;
            at = next_[after]; // every other corner first: fatter triangles than a fan
        }
        triangles.push_back({at, next_[at], next_[next_[at]]});
    }

private:
    bool is_ear(std::uint32_t b) {
        const std::uint32_t a = previous_[b], c = next_[b];
        const Point &pa = point_[a], &pb = point_[b], &pc = point_[c];
        if (turn(pa, pb, pc) <= 0.0) return false;
        for (std::uint32_t other = next_[c]; other != a; other = next_[other]) {
            if (tests_left_ == 0) return true;
            --tests_left_;
            const Point& p = point_[other];
            // A corner that repeats one of the ear's (a bridge to a hole) does not block it.
            if (p == pa || p == pb || p == pc) continue;
            if (turn(pa, pb, p) >= 0.0 && turn(pb, pc, p) >= 0.0 && turn(pc, pa, p) >= 0.0)
                return false;
        }
        return true;
    }

    std::vector<Point> point_;
    std::vector<std::uint32_t> next_, previous_;
    std::size_t tests_left_, refusals_left_; // a corner on an edge is refused without a test
};

/// True where the diagonal from corner 0 to corner 2 lies inside a quadrilateral.
bool diagonal_02_is_inside(const std::vector<Point>& p) {
    return turn(p[0], p[1], p[2]) > 0.0 && turn(p[0], p[2], p[3]) > 0.0;
}
bool diagonal_13_is_inside(const std::vector<Point>& p) {
    return turn(p[0], p[1], p[3]) > 0.0 && turn(p[1], p[2], p[3]) > 0.0;
}

} // namespace

void triangulate(std::span<const Vec3> corner,
                 std::vector<std::array<std::uint32_t, 3>>& triangles) {
    assert(corner.size() >= 3);
    if (corner.size() == 3) {
        triangles.push_back({0, 1, 2});
        return;
    }
    std::vector<Point> flat = flatten(corner);
    if (corner.size() == 4) {
        const bool first = diagonal_02_is_inside(flat), second = diagonal_13_is_inside(flat);
        const bool shorter = (corner[2] - corner[0]).norm() <= (corner[3] - corner[1]).norm();
        if (first == second ? shorter : first)
            triangles.insert(triangles.end(), {{0, 1, 2}, {0, 2, 3}});
        else
            triangles.insert(triangles.end(), {{0, 1, 3}, {1, 2, 3}});
        return;
    }
    EarClipper(std::move(flat)).clip(triangles);
}

} // namespace afterglow
