#include "viewer/light_solver.h"

namespace afterglow {

LightSolver::LightSolver(const TransferScene& scene, int most_rounds)
    : light_(scene.transport, {.most_rounds = most_rounds}), dark_(scene.file.transfer.points) {
    if (scene.file.transfer.kind == OperatorKind::paper)
        flattening_.emplace(scene.file.transfer.points, scene.surface);
}

std::shared_ptr<const DisplayField> LightSolver::solve(const Spotlight& light) {
    const VectorIrradiance& field = light_.follow(light, &statistics_);
    auto lit = std::make_shared<DisplayField>(dark_);
    if (flattening_) {
        VectorIrradiance flat = field;
        flattening_->apply(flat);
        lit->set(flat);
    } else {
        lit->set(field);
    }
    return lit;
}

} // namespace afterglow
