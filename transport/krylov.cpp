#include "transport/krylov.h"

#include "core/parallel.h"

#include <Eigen/Jacobi>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <type_traits>
#include <utility>

namespace afterglow {
namespace {

constexpr int most_channels = 3, most_products = 60;
using PerChannel = Eigen::Array<double, most_channels, 1>;

/// Calls function(std::integral_constant<int, channels>()): loops over channels whose number is known are not loops.
template <class Function>
auto with_channels(int channels, const Function& function) {
    switch (channels) {
        case 1: return function(std::integral_constant<int, 1>());
        case 2: return function(std::integral_constant<int, 2>());
        default: return function(std::integral_constant<int, 3>());
    }
}

PerChannel dot(const std::vector<float>& a, const std::vector<float>& b, int channels) {
    return with_channels(channels, [&](auto fixed) {
        constexpr Index n = fixed;
        return parallel_sum<PerChannel>(
            static_cast<Index>(a.size()) / n, PerChannel::Zero(),
            [&a, &b](Index i) {
                PerChannel product = PerChannel::Zero();
                for (Index c = 0; c < n; ++c) product[c] = static_cast<double>(a[i * n + c]) * b[i * n + c];
                return product;
            },
            4096);
    });
}

/// y += factor_c x, channel by channel.
void add(std::vector<float>& y, const PerChannel& factor, const std::vector<float>& x, int channels) {
    const Eigen::Array<float, most_channels, 1> f = factor.cast<float>();
    with_channels(channels, [&](auto fixed) {
        constexpr Index n = fixed;
        parallel_ranges(static_cast<Index>(y.size()) / n, 4096, [&y, &x, f](Index begin, Index end) {
            float* const to = y.data();
            const float* const from = x.data();
            for (Index i = begin; i < end; ++i)
                for (Index c = 0; c < n; ++c) to[i * n + c] += f[c] * from[i * n + c];
        });
    });
}

/// The least squares problem of a channel, min |size e_0 - H y|, where H grows by a column a time: rotations make it
/// triangular [Saad, Iterative Methods for Sparse Linear Systems, section 6.5.3]. O(k) for column k.
class ArnoldiLeastSquares {
public:
    explicit ArnoldiLeastSquares(double size) : rest_{size} {}

    /// Column k of k + 2 numbers, the last of which is not negative.
    void append(std::vector<double> column) {
        const std::size_t k = rotation_.size();
        for (std::size_t j = 0; j < k; ++j) rotate(rotation_[j], column[j], column[j + 1]);
        Rotation& last = rotation_.emplace_back(0.0, 1.0); // a column that is zero leaves unmet what was
        if (column[k] != 0.0 || column[k + 1] != 0.0) last.makeGivens(column[k], column[k + 1]);
        rotate(last, column[k], column[k + 1]);
        rest_.push_back(0.0);
        rotate(last, rest_[k], rest_[k + 1]);
        column_.push_back(std::move(column));
    }
    double residual() const { return std::abs(rest_.back()); }
    /// y; zero where a column adds nothing.
    std::vector<double> solution() const {
        std::vector<double> y(rest_.begin(), rest_.end() - 1);
        for (std::size_t k = y.size(); k-- > 0;) {
            const double pivot = column_[k][k];
            y[k] = pivot != 0.0 ? y[k] / pivot : 0.0;
            for (std::size_t j = 0; j < k; ++j) y[j] -= y[k] * column_[k][j];
        }
        return y;
    }

private:
    using Rotation = Eigen::JacobiRotation<double>;
    static void rotate(const Rotation& r, double& a, double& b) {
        const double first = r.c() * a - r.s() * b;
        b = r.s() * a + r.c() * b;
        a = first;
    }

    std::vector<std::vector<double>> column_; // of the triangle
    std::vector<Rotation> rotation_;
    std::vector<double> rest_; // the right hand side, rotated; its last number is what is not met
};

/// 1 / x where x is not zero.
PerChannel inverse(const PerChannel& x) { return (x > 0.0).select(1.0 / x.max(1e-300), 0.0); }

} // namespace

KrylovResult solve_second_kind(
    const std::function<std::vector<float>(const std::vector<float>&)>& apply,
    const std::vector<float>& b, int channels, double tolerance) {
    assert(channels <= most_channels);
    KrylovResult result;
    result.solution = b;
    // x = b + z with (I - K) z = K b: start from the first bounce, which is what the tolerance means.
    std::vector<float> first = apply(b);
    result.products = 1;
    const PerChannel size = dot(first, first, channels).sqrt();
    if (size.maxCoeff() <= 0.0) return result;

    std::vector<std::vector<float>> basis;
    std::vector<float> q(b.size(), 0.0f);
    add(q, inverse(size), first, channels);
    basis.push_back(std::move(q));
    std::vector<ArnoldiLeastSquares> problem; // a channel each
    for (int c = 0; c < channels; ++c) problem.emplace_back(size[c]);

    for (int k = 0; k < most_products; ++k) {
        // Arnoldi for A = I - K: w = q_k - K q_k, made orthogonal to all before (modified Gram-Schmidt).
        std::vector<float> w = basis[k];
        add(w, PerChannel::Constant(-1.0), apply(basis[k]), channels);
        ++result.products;
        std::vector<PerChannel> column;
        for (int j = 0; j <= k; ++j) {
            column.push_back(dot(basis[j], w, channels));
            add(w, -column.back(), basis[j], channels);
        }
        const PerChannel norm = dot(w, w, channels).sqrt();
        column.push_back(norm);
        result.residual = 0.0;
        for (int c = 0; c < channels; ++c) {
            std::vector<double> of_channel;
            for (const PerChannel& h : column) of_channel.push_back(h[c]);
            problem[c].append(std::move(of_channel));
            if (size[c] > 0.0) result.residual = std::max(result.residual, problem[c].residual() / size[c]);
        }
        if (result.residual <= tolerance || norm.maxCoeff() <= 0.0) break;
        if (k + 1 == most_products) break;
        // Of a channel that is done, w is rounding: no direction that its solution could go on in.
        PerChannel scale = inverse(norm);
        for (int c = 0; c < channels; ++c)
            if (problem[c].residual() <= tolerance * size[c]) scale[c] = 0.0;
        std::vector<float> next(b.size(), 0.0f);
        add(next, scale, w, channels);
        basis.push_back(std::move(next));
    }
    std::vector<PerChannel> factor(basis.size(), PerChannel::Zero());
    for (int c = 0; c < channels; ++c) {
        const std::vector<double> y = problem[c].solution();
        for (std::size_t j = 0; j < y.size(); ++j) factor[j][c] = y[j];
    }
    for (std::size_t j = 0; j < basis.size(); ++j) add(result.solution, factor[j], basis[j], channels);
    return result;
}

} // namespace afterglow
