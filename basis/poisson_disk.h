#pragma once

#include "basis/candidates.h"
#include "basis/openness.h"
#include "basis/shepard.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace afterglow {

struct PoissonDiskOptions {
    float spacing = 1.0f;     // R: no two points are closer than this in the distance D [world]
    int placement_power = 16; // of the cosine in D, see BasisShape
    /// Leave out narrow places, where the harmonic mean distance to what is around is below R/6
    /// [LZT08, sec. 2.3]; finer levels fill them.
    bool skip_narrow = false;
    /// With a density s > 0, points may come as close as R/32 where the openness feature changes:
    /// y conflicts with x if D < R/32, or if D exp(|dF|^2 / (2 s^2)) < R.
    float openness_density = 0.0f;
    /// Darts are thrown until a round yields fewer points than one of so many: holes are then about
    /// 1 / candidates_per_point of what candidates find. Where a density is asked, they are filled afterwards, and
    /// darts without a feature go on until one of `candidates_per_last_point` fits.
    int candidates_per_point = 48, candidates_per_last_point = 800;
};

struct PoissonDisk {
    std::vector<Candidate> points;
    std::vector<Openness> openness; // a point each where a density was asked, else empty
    std::size_t candidates_tried = 0; // of the source
};

/// A Poisson-disk set of the candidates, maximal but for holes (see candidates_per_point), by dart throwing under
///
///     D(x, y) = min(d_x(y), d_y(x)) / max(0, n_x . n_y)^power     [LZT08, eq. (11)].
///
/// Cells of size R, in eight classes whose members cannot conflict, are filled in parallel; the
/// result does not depend on the number of threads. D is never below the Euclidean distance, so the
/// 27 cells around a candidate decide. Where a density is asked, a cell adds no points closer than R once 24
/// candidates in a row had their feature estimated there in vain. Holes are found around the darts, not by
/// more candidates, so also where few of them come; but not beyond the last darts, unless a quarter of what is
/// seen from there is empty.
PoissonDisk poisson_disk(CandidateSource& source, const PoissonDiskOptions& options);

} // namespace afterglow
