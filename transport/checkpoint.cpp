#include "transport/checkpoint.h"

#include "core/error.h"
#include "core/seconds.h"
#include "transport/safetensors.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace afterglow {
namespace {

using Json = nlohmann::json;

constexpr const char* format_name = "afterglow checkpoint";
constexpr const char* rows_name = "checkpoint.made_rows";
constexpr double least_work_a_save = 100.0;

Json counts_json(const PrecomputeReport& report) {
    Json viewpoints = Json::array(), levels = Json::array();
    for (const Vec3& v : report.viewpoints) viewpoints.push_back({v.x(), v.y(), v.z()});
    for (const LevelStatistics& level : report.hierarchy.level)
        levels.push_back({level.points, level.candidates_tried});
    return {{"viewpoints", viewpoints},
            {"mean_ray_length", report.mean_ray_length},
            {"levels", levels},
            {"points_rays", report.points_rays},
            {"link_rays", report.links.rays},
            {"links_before", report.links.links_before}};
}

/// Throws Json::exception for what is no such object.
PrecomputeReport counts_of(const Json& json) {
    // JSON has no number for what is not finite.
    const auto real = [](const Json& value) {
        return value.is_null() ? std::numeric_limits<float>::infinity() : value.get<float>();
    };
    PrecomputeReport report;
    for (const Json& v : json.at("viewpoints"))
        report.viewpoints.emplace_back(real(v.at(0)), real(v.at(1)), real(v.at(2)));
    for (const Json& level : json.at("levels"))
        report.hierarchy.level.push_back({level.at(0), level.at(1)});
    report.mean_ray_length = json.at("mean_ray_length");
    report.points_rays = json.at("points_rays");
    report.links.rays = json.at("link_rays");
    report.links.links_before = json.at("links_before");
    return report;
}

} // namespace

Checkpoint::Checkpoint(std::string path, TransferProvenance asked, double seconds_between)
    : path_(std::move(path)), asked_(std::move(asked)), seconds_between_(seconds_between) {
    std::error_code ignored;
    if (!std::filesystem::exists(path_, ignored)) return;
    try {
        read();
    } catch (const Error& error) {
        throw Error(std::string(error.what()) + "; to begin anew, name another --checkpoint or delete this one");
    }
}

void Checkpoint::read() {
    TransferFile file = load_transfer(path_, format_name);
    const TransferProvenance& p = file.provenance;
    const auto refuse = [&](const std::string& what) { throw FileError(path_, "is the checkpoint of another " + what); };
    if (p.version != asked_.version) refuse("version of afterglow, " + p.version);
    if (p.scene_hash != asked_.scene_hash) refuse("scene, or its files have changed: content hash " + p.scene_hash);
    if (p.seed != asked_.seed) refuse("seed, " + std::to_string(p.seed));
    if (p.options != asked_.options) refuse("precomputation, with the options " + p.options);

    State state;
    state.transfer = std::move(file.transfer);
    const SafetensorsFile again(path_);
    const auto rows = again.tensor<std::uint32_t>(rows_name, {any_extent});
    state.made_rows.assign(rows.begin(), rows.end());
    bool good = false;
    try {
        const Json json = Json::parse(p.statistics);
        state.done = json.at("done");
        found_scale_ = json.at("coarse_scale");
        state.report = counts_of(json.at("counts"));
        good = state.done <= state.transfer.points.size() && !state.report.viewpoints.empty()
               && state.report.hierarchy.level.size() == state.transfer.points.spacing.size();
    } catch (const Json::exception&) {
    }
    if (!good) throw FileError(path_, "holds counts that are none");
    found_ = std::move(state);
}

std::optional<Checkpoint::State> Checkpoint::take(float coarse_scale) {
    scale_ = coarse_scale;
    if (!found_ || found_scale_ < coarse_scale) return std::nullopt;
    std::optional<State> found = std::exchange(found_, std::nullopt);
    return found_scale_ == coarse_scale ? std::move(found) : std::nullopt;
}

bool Checkpoint::is_due() const {
    if (found_) return false;
    return seconds_between_ == 0.0
           || seconds_since(saved_) >= std::max(seconds_between_, least_work_a_save * save_seconds_);
}

void Checkpoint::save(const TransferOperator& transfer, std::uint32_t done,
                      const std::vector<std::uint32_t>& made_rows, const PrecomputeReport& report) {
    if (found_) return;
    const auto start = std::chrono::steady_clock::now();
    TransferProvenance provenance = asked_;
    provenance.statistics =
        Json{{"done", done}, {"coarse_scale", scale_}, {"counts", counts_json(report)}}.dump();
    save_transfer(path_, transfer, provenance, format_name,
                  {make_tensor(rows_name, {made_rows.size()}, std::span(made_rows))});
    saved_ = std::chrono::steady_clock::now();
    save_seconds_ = std::chrono::duration<double>(saved_ - start).count();
}

void Checkpoint::remove() {
    ::unlink(path_.c_str());
}

} // namespace afterglow
