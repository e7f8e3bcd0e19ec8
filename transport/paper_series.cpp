#include "transport/paper_series.h"

#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <memory>

namespace afterglow {
namespace {

using Row = std::vector<SparseEntry<RgbLink>>;

/// The rows of T_0 P n. S are found from the left: a row of T_0 is a functional of sender
/// coefficients, nine numbers each (an axis of what arrives at the receiver, times a colour), and
/// goes through the transposes of P and n., then S.
class RowProduct {
public:
    /// `seen`: for each receiver the senders at whose centres its function is not zero, with its
    /// value there; of all senders that keep a value of their own in the pull.
    RowProduct(const PointHierarchy& points, int sender_levels, const Pyramid& pyramid,
               const PullOperator& pull, const SparseRows<float>& seen)
        : points_(points), sender_levels_(sender_levels), pyramid_(pyramid), pull_(pull),
          seen_(seen), functional_(points.end(sender_levels - 1)), sum_(functional_.size()) {}

    /// The row of T + T_0 P n. S that belongs to a row of T_0, less what is below the threshold.
    Row next(const Row& row_of_t, const std::vector<Row>& rows_of_s, float threshold) {
        std::fill(functional_.begin(), functional_.end(), RgbLink::Zero());
        std::fill(sum_.begin(), sum_.end(), RgbLink::Zero());
        for (const auto& link : row_of_t)
            functional_[link.index] = sum_[link.index] = link.value;
        analyse_transposed();
        pull_transposed();
        for (std::uint32_t r = 0; r < points_.size(); ++r) {
            if (rows_of_s[r].empty() || seen_.indices(r).empty()) continue;
            const Through through = at_receiver(r);
            for (const auto& link : rows_of_s[r])
                sum_[link.index] += product(through, link.value);
        }
        Row row;
        for (std::uint32_t j = 0; j < sum_.size(); ++j)
            if (magnitude(sum_[j]) > threshold) row.push_back({j, sum_[j]});
        return row;
    }

private:
    using Through = std::array<RgbLink, 3>; // an axis of the receiver r each

    void analyse_transposed() {
        for (std::uint32_t i = points_.end(sender_levels_ - 1); i-- > points_.end(0);) {
            const auto index = pyramid_.coarser.indices(i);
            const auto weight = pyramid_.coarser.values(i);
            for (std::size_t e = 0; e < index.size(); ++e)
                functional_[index[e]] -= weight[e] * functional_[i];
        }
    }

    void pull_transposed() {
        for (std::uint32_t k = 0; k < points_.begin(sender_levels_ - 1); ++k) {
            const auto child = pull_.children.indices(k);
            const auto share = pull_.children.values(k);
            if (child.empty()) continue;
            for (std::size_t e = 0; e < child.size(); ++e)
                functional_[child[e]] += share[e] * functional_[k];
            functional_[k].setZero();
        }
    }

    Through at_receiver(std::uint32_t r) const {
        Through through{RgbLink::Zero(), RgbLink::Zero(), RgbLink::Zero()};
        const auto sender = seen_.indices(r);
        const auto value = seen_.values(r);
        for (std::size_t e = 0; e < sender.size(); ++e)
            for (int axis = 0; axis < 3; ++axis)
                through[axis] +=
                    (value[e] * points_.normal(axis, sender[e])) * functional_[sender[e]];
        return through;
    }

    static RgbLink product(const Through& through, const RgbLink& link) {
        RgbLink result;
        for (int axis = 0; axis < 3; ++axis) {
            result.segment<3>(3 * axis).setZero();
            for (int inner = 0; inner < 3; ++inner)
                result.segment<3>(3 * axis) +=
                    through[inner].segment<3>(3 * axis) * link.segment<3>(3 * inner);
        }
        return result;
    }

    const PointHierarchy& points_;
    int sender_levels_;
    const Pyramid& pyramid_;
    const PullOperator& pull_;
    const SparseRows<float>& seen_;
    std::vector<RgbLink> functional_, sum_; // a sender each
};

/// See RowProduct.
SparseRows<float> senders_seen(const ShepardBasis& basis, int sender_levels,
                               const PullOperator& pull) {
    const PointHierarchy& points = basis.points();
    const std::uint32_t senders = points.end(sender_levels - 1);
    std::vector<std::vector<BasisEntry>> functions(senders);
    parallel_for(senders, [&](Index m) {
        if (m < pull.children.rows() && !pull.children.indices(m).empty()) return;
        for (int l = 0; l < points.levels(); ++l)
            basis.evaluate(l, points.point(m), functions[m]);
    });
    std::vector<std::vector<BasisEntry>> rows(points.size());
    for (std::uint32_t m = 0; m < senders; ++m)
        for (const BasisEntry& function : functions[m])
            rows[function.index].push_back({m, function.value});
    return join_rows(std::move(rows));
}

Row row_of(const RgbLinks& links, std::uint32_t i) {
    Row row;
    for (std::size_t e = 0; e < links.indices(i).size(); ++e)
        row.push_back({links.indices(i)[e], links.values(i)[e]});
    return row;
}

} // namespace

RgbLinks make_paper_series(RgbLinks links, const ShepardBasis& basis, int sender_levels,
                           const Pyramid& pyramid, const PullOperator& pull, int bounces,
                           float threshold) {
    if (bounces < 2) return links;
    const PointHierarchy& points = basis.points();
    const SparseRows<float> seen = senders_seen(basis, sender_levels, pull);
    ScratchPool<RowProduct> products([&] {
        return std::make_unique<RowProduct>(points, sender_levels, pyramid, pull, seen);
    });
    std::vector<Row> rows;
    for (std::uint32_t i = 0; i < points.size(); ++i)
        rows.push_back(row_of(links, i));
    const std::vector<Row> rows_of_t(rows.begin(), rows.begin() + points.end(0));
    for (int bounce = 2; bounce <= bounces; ++bounce) {
        std::vector<Row> next(rows_of_t.size());
        parallel_for(
            points.end(0),
            [&](Index i) { next[i] = products.borrow()->next(rows_of_t[i], rows, threshold); }, 1);
        std::move(next.begin(), next.end(), rows.begin());
    }
    return join_rows(std::move(rows));
}

} // namespace afterglow
