#include "transport/transfer_file.h"

#include "core/builtin_scenes.h"
#include "core/error.h"
#include "core/obj_loader.h"
#include "core/parallel.h"
#include "core/text.h"
#include "transport/link_products.h"
#include "transport/safetensors.h"
#include "transport/sender_rows.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <system_error>

namespace afterglow {
namespace {

using Json = nlohmann::json;

constexpr const char* format_version = "4";

static_assert(sizeof(PackedLink) == 3, "links are mapped as rows of three bytes");
static_assert(sizeof(RgbLink) == 36, "links are mapped as rows of nine floats");

// The scene's path

/// Absolute and without symbolic links, as far as the file system tells.
std::filesystem::path resolved(const std::filesystem::path& path) {
    std::error_code ignored;
    const auto absolute = std::filesystem::absolute(path, ignored);
    const auto canonical = std::filesystem::weakly_canonical(absolute, ignored);
    return ignored ? absolute.lexically_normal() : canonical;
}

/// The folder that a transfer file really lies in: where its relative paths start.
std::filesystem::path folder_of(const std::string& path) {
    return resolved(path).parent_path();
}

std::string opened_scene_path(const std::string& file, const std::string& stored) {
    if (is_builtin_scene(stored) || std::filesystem::path(stored).is_absolute()) return stored;
    return (folder_of(file) / stored).lexically_normal().string();
}

// What the computation needs to know beside the arrays

std::string model_text(const TransferOperator& transfer) {
    return Json{{"operator", operator_name(transfer.kind)},
                {"sender_levels", transfer.sender_levels},
                {"display_parent", transfer.points.parent_level.back()},
                {"bounces", transfer.bounces},
                {"openness_level", std::min(transfer.points.openness_level, transfer.points.levels())},
                {"weight_power", transfer.points.shape.weight_power}}
        .dump();
}

// Checking

/// Takes a file's tensors and metadata into a TransferOperator, trusting nothing.
class Reader {
public:
    Reader(const SafetensorsFile& file, const std::string& format) : file_(file), format_(format) {}

    void read(TransferFile& result) {
        check_format();
        read_points(result.transfer.points);
        read_model(result.transfer);
        read_openness(result.transfer.points);
        read_pull(result.transfer);
        if (result.transfer.kind == OperatorKind::paper) {
            read_pyramid(result.transfer);
            read_solution(result.transfer);
        } else {
            read_push(result.transfer);
            read_sender_areas(result.transfer);
            read_links(result.transfer);
        }
        read_provenance(result.provenance);
        for (const Tensor& tensor : file_.tensors())
            result.tensor_bytes.emplace_back(tensor.name, tensor.bytes.size());
    }

private:
    [[noreturn]] void fail(const std::string& what) const {
        throw FileError(file_.path(), what + "; run precompute again");
    }

    void check_format() const {
        if (file_.metadata("format") != format_) throw FileError(file_.path(), "is no file of the format " + format_);
        const std::string& version = file_.metadata("format_version");
        if (version != format_version)
            fail("has another format version than " + std::string(format_version)
                 + ", which this program reads");
    }

    template <class T>
    std::span<const T> tensor(const std::string& name, const TensorShape& shape) const {
        return file_.tensor<T>(name, shape);
    }
    template <class T>
    SharedArray<T> shared(std::span<const T> values) const {
        return {values, file_.map()};
    }

    void read_points(PointHierarchy& points) const {
        const auto level_begin = tensor<std::uint32_t>("level_begin", {any_extent});
        const auto spacing = tensor<float>("spacing", {any_extent});
        if (spacing.empty() || spacing.size() > 32 || level_begin.size() != spacing.size() + 1
            || level_begin[0] != 0 || !std::is_sorted(level_begin.begin(), level_begin.end())
            || level_begin.back() == 0 || level_begin.back() == no_index)
            fail("has levels that are not consecutive ranges of points");
        const std::uint64_t count = level_begin.back();
        const auto position = tensor<float>("points.position", {count, 3});
        const auto normal = tensor<float>("points.normal", {count, 3});
        const auto support = tensor<float>("points.support", {count});
        const auto reflectance = tensor<float>("points.reflectance", {count, 3});
        const auto all = [](std::span<const float> values, const auto& good) {
            return std::all_of(values.begin(), values.end(), good);
        };
        // Rays start at points, lifted by a share of their support.
        const auto reachable = [](float x) { return std::abs(x) <= largest_coordinate; };
        const auto positive = [](float x) { return x > 0.0f && x <= largest_coordinate; };
        if (!all(spacing, positive)) fail("has a spacing that is not positive or too large");
        if (!all(position, reachable)) fail("has a point at no position that a scene can have");
        if (!all(support, positive)) fail("has a support that is not positive or too large");
        if (!all(reflectance, [](float x) { return x >= 0.0f && x < 1.0f; }))
            fail("has a reflectance outside [0, 1)");
        const auto n = static_cast<Index>(count);
        points.level_begin.assign(level_begin.begin(), level_begin.end());
        points.spacing.assign(spacing.begin(), spacing.end());
        points.position = Eigen::Matrix3Xf::Map(position.data(), 3, n);
        points.normal = Eigen::Matrix3Xf::Map(normal.data(), 3, n);
        points.support = Eigen::VectorXf::Map(support.data(), n);
        points.reflectance = Eigen::Matrix3Xf::Map(reflectance.data(), 3, n);
        // Negated, so that a NaN fails.
        const auto length_error = (points.normal.colwise().squaredNorm().array() - 1.0f).abs();
        if (!(length_error < 1e-3f).all()) fail("has a normal that is not of unit length");
    }

    void read_model(TransferOperator& transfer) const {
        const Json model = parse("model");
        const Json name = model.value("operator", Json());
        if (name == operator_name(OperatorKind::paper))
            transfer.kind = OperatorKind::paper;
        else if (name != operator_name(OperatorKind::neumann))
            fail("holds an operator that this program does not know");
        const int levels = transfer.points.levels();
        transfer.sender_levels = integer(model, "sender_levels", 1, levels);
        for (int l = 0; l < levels; ++l) transfer.points.parent_level.push_back(l - 1);
        const bool paper = transfer.kind == OperatorKind::paper;
        if (levels > 1)
            transfer.points.parent_level.back() =
                integer(model, "display_parent", paper ? levels - 2 : 0, levels - 2);
        transfer.bounces = integer(model, "bounces", paper ? 1 : 0, most_bounces);
        transfer.points.shape.weight_power = integer(model, "weight_power", 1, 1000);
        transfer.points.openness_level = integer(model, "openness_level", 0, levels);
        if (transfer.senders() == 0) fail("has no senders");
    }

    void read_openness(PointHierarchy& points) const {
        constexpr Index numbers = OpennessCode::RowsAtCompileTime;
        const Index count = points.size() - points.level_begin[points.openness_level];
        const auto codes = tensor<std::int8_t>(
            "points.openness", {static_cast<std::uint64_t>(count), numbers});
        points.openness =
            Eigen::Map<const decltype(points.openness)>(codes.data(), numbers, count);
    }

    Json parse(const std::string& key) const {
        Json json = Json::parse(file_.metadata(key), nullptr, false);
        if (!json.is_object()) fail("has metadata '" + key + "' that is no JSON object");
        return json;
    }

    int integer(const Json& model, const char* key, int least, int most) const {
        const auto value = model.find(key);
        if (value == model.end() || !value->is_number_integer() || *value < least || *value > most)
            fail(std::string("needs ") + key + " between " + std::to_string(least) + " and "
                 + std::to_string(most));
        return value->get<int>();
    }

    /// Offsets of `rows` rows over `entries` entries: from 0, never falling.
    SharedArray<std::uint64_t> read_begin(const std::string& name, std::uint64_t rows,
                                          std::uint64_t entries) const {
        const auto begin = tensor<std::uint64_t>(name, {rows + 1});
        if (begin.front() != 0 || begin.back() != entries
            || !std::is_sorted(begin.begin(), begin.end()))
            fail("has row offsets '" + name + "' that do not rise from 0 to the last entry");
        return shared(begin);
    }

    /// Fails unless the indices of every row in [first, last) rise strictly within [low, high).
    template <class Value>
    void check_rows(const std::string& name, const SparseRows<Value>& rows, std::uint32_t first,
                    std::uint32_t last, std::uint64_t low, std::uint64_t high) const {
        parallel_ranges(last - first, 1024, [&](Index from, Index to) {
            for (Index row = first + from; row < first + to; ++row) {
                std::int64_t before = static_cast<std::int64_t>(low) - 1;
                bool good = true;
                for (const std::uint32_t index : rows.indices(row)) {
                    good &= before < index;
                    before = index;
                }
                if (!good || before >= static_cast<std::int64_t>(high))
                    fail("has indices '" + name + "' of which a row is unsorted or out of range");
            }
        });
    }

    void read_push(TransferOperator& transfer) const {
        const PointHierarchy& points = transfer.points;
        const SparseRows<float> rows = read_shares("push", points.size());
        check_rows("push.index", rows, 0, points.end(0), 0, 0);
        for (int l = 1; l < points.levels(); ++l)
            check_rows("push.index", rows, points.begin(l), points.end(l),
                       points.begin(points.parent_level[l]), points.end(points.parent_level[l]));
        transfer.push.parents = rows;
    }

    void read_sender_areas(TransferOperator& transfer) const {
        const std::uint64_t first = transfer.points.begin(transfer.sender_levels - 1);
        const auto areas = tensor<float>("senders.area", {transfer.senders() - first});
        if (!std::all_of(areas.begin(), areas.end(),
                         [](float x) { return (x >= 0.0f && std::isfinite(x)) || x == SenderRows::in_few_rows; }))
            fail("has a sender of no finite area");
        transfer.sender_areas.assign(areas.begin(), areas.end());
    }

    void read_pull(TransferOperator& transfer) const {
        const PointHierarchy& points = transfer.points;
        const SparseRows<float> rows =
            read_shares("pull", points.begin(transfer.sender_levels - 1));
        for (int l = 0; l + 1 < transfer.sender_levels; ++l)
            check_rows("pull.index", rows, points.begin(l), points.end(l), points.begin(l + 1),
                       points.end(l + 1));
        transfer.pull.children = rows;
    }

    void read_pyramid(TransferOperator& transfer) const {
        const PointHierarchy& points = transfer.points;
        const SparseRows<float> rows = read_shares("pyramid", transfer.senders());
        for (int l = 0; l < transfer.sender_levels; ++l)
            check_rows("pyramid.index", rows, points.begin(l), points.end(l), 0, points.begin(l));
        transfer.pyramid.coarser = rows;
    }

    /// Rows of shares; their indices are still to be checked.
    SparseRows<float> read_shares(const std::string& name, std::uint64_t rows) const {
        const auto index = tensor<std::uint32_t>(name + ".index", {any_extent});
        const auto value = tensor<float>(name + ".value", {index.size()});
        if (!std::all_of(value.begin(), value.end(), [](float x) { return x >= 0.0f && x < 2.0f; }))
            fail("has a " + name + " weight that is no share");
        return {read_begin(name + ".begin", rows, index.size()), shared(index), shared(value)};
    }

    void read_links(TransferOperator& transfer) const {
        Links& links = transfer.links;
        const auto bytes = tensor<std::uint8_t>("links.packed", {any_extent, sizeof(PackedLink)});
        const std::uint64_t entries = bytes.size() / sizeof(PackedLink);
        links.begin = read_begin("links.begin", transfer.points.size(), entries);
        links.entry = {{reinterpret_cast<const PackedLink*>(bytes.data()), entries}, file_.map()};
        parallel_ranges(links.rows(), 1024, [&](Index from, Index to) {
            bool good = true;
            for (Index row = from; row < to; ++row) good &= is_sound_row(links, row, transfer.senders());
            if (!good) fail("has a row of links that does not rise or leaves the senders");
        });
    }

    void read_solution(TransferOperator& transfer) const {
        const std::uint32_t points = transfer.points.size();
        RgbLinks& links = transfer.solution;
        const auto index = tensor<std::uint32_t>("solution.index", {any_extent});
        const auto value = tensor<float>("solution.value", {index.size(), 9});
        if (!std::all_of(value.begin(), value.end(), [](float x) { return std::isfinite(x); }))
            fail("has a link that is not finite");
        links = {read_begin("solution.begin", points, index.size()), shared(index),
                 {{reinterpret_cast<const RgbLink*>(value.data()), index.size()}, file_.map()}};
        check_rows("solution.index", links, 0, points, 0, transfer.senders());
    }

    void read_provenance(TransferProvenance& provenance) const {
        const std::string& seed = file_.metadata("seed");
        const auto [end, error] =
            std::from_chars(seed.data(), seed.data() + seed.size(), provenance.seed);
        if (error != std::errc{} || end != seed.data() + seed.size())
            fail("has a seed that is no number");
        provenance.version = line("version");
        provenance.scene = opened_scene_path(file_.path(), line("scene"));
        provenance.scene_hash = line("scene_hash");
        provenance.options = file_.metadata("options");
        provenance.statistics = file_.metadata("statistics");
        parse("options");
        parse("statistics");
    }

    /// Metadata that messages repeat: one short line.
    const std::string& line(const std::string& key) const {
        const std::string& text = file_.metadata(key);
        if (!is_line_of_text(text)) fail("has metadata '" + key + "' that is no line of text");
        return text;
    }

    const SafetensorsFile& file_;
    const std::string& format_;
};

template <class Scalar, int Rows, int Columns>
std::span<const Scalar> values_of(const Eigen::Matrix<Scalar, Rows, Columns>& matrix) {
    return {matrix.data(), static_cast<std::size_t>(matrix.size())};
}

} // namespace

std::string stored_scene_path(const std::string& file, const std::string& scene) {
    if (is_builtin_scene(scene)) return scene;
    const std::filesystem::path name(scene);
    const auto folder = resolved(name.has_parent_path() ? name.parent_path() : ".");
    const auto relative = folder.lexically_relative(folder_of(file));
    return ((relative.empty() ? folder : relative) / name.filename()).lexically_normal().string();
}

std::uint64_t save_transfer(const std::string& path, const TransferOperator& transfer,
                            const TransferProvenance& provenance, const std::string& format,
                            const std::vector<Tensor>& further) {
    const PointHierarchy& points = transfer.points;
    const std::uint64_t count = points.size(), levels = points.spacing.size();
    std::vector<Tensor> tensors;
    const auto add = [&](std::string name, TensorShape shape, auto values) {
        tensors.push_back(make_tensor(std::move(name), std::move(shape), values));
    };
    const auto add_rows = [&](const std::string& name, const SparseRows<float>& rows) {
        add(name + ".begin", {rows.begin.size()}, rows.begin.span());
        add(name + ".index", {rows.entries()}, rows.index.span());
        add(name + ".value", {rows.entries()}, rows.value.span());
    };
    add("points.position", {count, 3}, values_of(points.position));
    add("points.normal", {count, 3}, values_of(points.normal));
    add("points.support", {count}, values_of(points.support));
    add("points.reflectance", {count, 3}, values_of(points.reflectance));
    add("points.openness", {static_cast<std::uint64_t>(points.openness.cols()), OpennessCode::RowsAtCompileTime},
        values_of(points.openness));
    add("level_begin", {levels + 1}, std::span(points.level_begin));
    add("spacing", {levels}, std::span(points.spacing));
    if (transfer.kind == OperatorKind::paper) {
        const RgbLinks& links = transfer.solution;
        add_rows("pyramid", transfer.pyramid.coarser);
        add_rows("pull", transfer.pull.children);
        add("solution.begin", {count + 1}, links.begin.span());
        add("solution.index", {links.entries()}, links.index.span());
        add("solution.value", {links.entries(), 9},
            std::span(reinterpret_cast<const float*>(links.value.data()), 9 * links.entries()));
    } else {
        const Links& links = transfer.links;
        add_rows("push", transfer.push.parents);
        add_rows("pull", transfer.pull.children);
        add("senders.area", {transfer.sender_areas.size()}, std::span(transfer.sender_areas));
        add("links.begin", {count + 1}, links.begin.span());
        add("links.packed", {links.entries(), sizeof(PackedLink)},
            std::span(reinterpret_cast<const std::uint8_t*>(links.entry.data()),
                      sizeof(PackedLink) * links.entries()));
    }

    tensors.insert(tensors.end(), further.begin(), further.end());
    return write_safetensors(path, tensors,
                             {{"format", format},
                              {"format_version", format_version},
                              {"version", provenance.version},
                              {"scene", stored_scene_path(path, provenance.scene)},
                              {"scene_hash", provenance.scene_hash},
                              {"seed", std::to_string(provenance.seed)},
                              {"model", model_text(transfer)},
                              {"options", provenance.options},
                              {"statistics", provenance.statistics}});
}

TransferFile load_transfer(const std::string& path, const std::string& format) {
    const SafetensorsFile file(path);
    TransferFile result;
    Reader(file, format).read(result);
    return result;
}

Scene load_transfer_scene(const std::string& path, const TransferProvenance& provenance,
                          const std::string& override_path) {
    const std::string& wanted = override_path.empty() ? provenance.scene : override_path;
    std::error_code ignored;
    if (override_path.empty() && !is_builtin_scene(wanted)
        && !std::filesystem::exists(wanted, ignored))
        throw FileError(path, "was made from the scene " + wanted
                                  + ", which is not there; name it with --scene");
    Scene scene;
    try {
        scene = load_scene(wanted);
    } catch (const UsageError& error) {
        // The name of a built-in scene out of a file is no fault of the command line.
        if (!override_path.empty()) throw;
        throw FileError(path, error.what());
    }
    if (const std::string hash = scene.content_hash(); hash != provenance.scene_hash)
        throw FileError(path, "was made from a scene with content hash " + provenance.scene_hash
                                  + ", but " + wanted + " has " + hash
                                  + "; run precompute again, or name the right one with --scene");
    return scene;
}

} // namespace afterglow
