#pragma once

#include <functional>
#include <vector>

namespace afterglow {

struct KrylovResult {
    std::vector<float> solution;
    int products = 0;
    double residual = 0.0; // |b - (I - K) x| / |K b|, the worst channel
};

/// Solves (I - K) x = b, that is x = b + K b + K^2 b + ..., by GMRES without restart. `channels`
/// interleaved systems share each product with K but have Krylov coefficients of their own. Ends when
/// every channel's residual is at most `tolerance` times |K b|, each taking no further part once its own is, or after
/// 61 products. Sums are added
/// in a fixed order: the result does not depend on the number of threads.
KrylovResult solve_second_kind(
    const std::function<std::vector<float>(const std::vector<float>&)>& apply,
    const std::vector<float>& b, int channels, double tolerance);

} // namespace afterglow
