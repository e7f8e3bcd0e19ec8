#include "transport/krylov.h"

#include "core/parallel.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <type_traits>

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
    std::array<Eigen::MatrixXd, most_channels> hessenberg;
    for (auto& h : hessenberg) h = Eigen::MatrixXd::Zero(most_products + 1, most_products);
    std::array<Eigen::VectorXd, most_channels> coefficient;

    for (int k = 0; k < most_products; ++k) {
        // Arnoldi for A = I - K: w = q_k - K q_k, made orthogonal to all before (modified Gram-Schmidt).
        std::vector<float> w = basis[k];
        add(w, PerChannel::Constant(-1.0), apply(basis[k]), channels);
        ++result.products;
        for (int j = 0; j <= k; ++j) {
            const PerChannel h = dot(basis[j], w, channels);
            for (int c = 0; c < channels; ++c) hessenberg[c](j, k) = h[c];
            add(w, -h, basis[j], channels);
        }
        const PerChannel norm = dot(w, w, channels).sqrt();
        result.residual = 0.0;
        for (int c = 0; c < channels; ++c) {
            hessenberg[c](k + 1, k) = norm[c];
            if (size[c] <= 0.0) {
                coefficient[c] = Eigen::VectorXd::Zero(k + 1);
                continue;
            }
            const auto h = hessenberg[c].topLeftCorner(k + 2, k + 1);
            Eigen::VectorXd rhs = Eigen::VectorXd::Zero(k + 2);
            rhs[0] = size[c];
            coefficient[c] = h.colPivHouseholderQr().solve(rhs);
            result.residual = std::max(result.residual, (rhs - h * coefficient[c]).norm() / size[c]);
        }
        if (result.residual <= tolerance || norm.maxCoeff() <= 0.0) break;
        if (k + 1 == most_products) break;
        std::vector<float> next(b.size(), 0.0f);
        add(next, inverse(norm), w, channels);
        basis.push_back(std::move(next));
    }
    for (std::size_t j = 0; j < basis.size(); ++j) {
        PerChannel factor = PerChannel::Zero();
        for (int c = 0; c < channels; ++c)
            if (static_cast<Index>(j) < coefficient[c].size()) factor[c] = coefficient[c][j];
        add(result.solution, factor, basis[j], channels);
    }
    return result;
}

} // namespace afterglow
