#include "core/polygon.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

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

/// Corners by where they lie, so that those in a small part of a large polygon are few to look at.
class CornerGrid {
public:
    explicit CornerGrid(const std::vector<Point>& point) {
        for (const Point& p : point) box_.extend(p);
        along_ = std::max<int>(1, static_cast<int>(std::sqrt(static_cast<double>(point.size()))));
        const auto cells = static_cast<std::size_t>(along_) * static_cast<std::size_t>(along_);
        begin_.assign(cells + 1, 0);
        for (const Point& p : point) ++begin_[cell(column(p.x(), 0), column(p.y(), 1)) + 1];
        std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
        corner_.resize(point.size());
        std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
        for (std::uint32_t i = 0; i < point.size(); ++i)
            corner_[next[cell(column(point[i].x(), 0), column(point[i].y(), 1))]++] = i;
    }

    /// Whether it holds of any corner in the cells that a box meets. Each cell and each corner costs one of
    /// `budget`; of what is beyond it, it does not hold.
    template <class Holds>
    bool any(const Eigen::AlignedBox2d& box, std::size_t& budget, const Holds& holds) const {
        const auto pay = [&] { return budget > 0 && budget-- > 0; };
        for (int y = column(box.min().y(), 1); y <= column(box.max().y(), 1); ++y)
            for (int x = column(box.min().x(), 0); x <= column(box.max().x(), 0); ++x) {
                if (!pay()) return false;
                for (std::uint32_t k = begin_[cell(x, y)]; k < begin_[cell(x, y) + 1]; ++k) {
                    if (!pay()) return false;
                    if (holds(corner_[k])) return true;
                }
            }
        return false;
    }

private:
    int column(double position, int axis) const {
        const double size = box_.sizes()[axis];
        if (!(size > 0.0)) return 0;
        return std::clamp(static_cast<int>((position - box_.min()[axis]) / size * along_), 0, along_ - 1);
    }
    std::size_t cell(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(along_) + static_cast<std::size_t>(x);
    }
    Eigen::AlignedBox2d box_;
    int along_ = 1;
    std::vector<std::uint32_t> begin_, corner_;
};

/// The polygon that is left while ears are cut off it: a ring of corners.
class EarClipper {
public:
    explicit EarClipper(std::vector<Point> point)
        : point_(std::move(point)), next_(point_.size()), previous_(point_.size()), is_cut_(point_.size()), grid_(point_) {
        const auto n = static_cast<std::uint32_t>(point_.size());
        for (std::uint32_t i = 0; i < n; ++i) {
            next_[i] = (i + 1) % n;
            previous_[i] = (i + n - 1) % n;
        }
        // Enough for any sensible face; one that is monstrous, or crosses itself, must not take quadratic time and more.
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
            is_cut_[at] = true;
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
        return !grid_.any(Eigen::AlignedBox2d(pa).extend(pb).extend(pc), tests_left_, [&](std::uint32_t other) {
            const Point& p = point_[other];
            // A corner that repeats one of the ear's (a bridge to a hole) does not block it.
            if (is_cut_[other] || p == pa || p == pb || p == pc) return false;
            return turn(pa, pb, p) >= 0.0 && turn(pb, pc, p) >= 0.0 && turn(pc, pa, p) >= 0.0;
        });
    }

    std::vector<Point> point_;
    std::vector<std::uint32_t> next_, previous_;
    std::vector<bool> is_cut_;
    CornerGrid grid_;
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
