#include "transport/command_info.h"

#include "transport/error_parts.h"
#include "transport/transfer_file.h"
#include "transport/verification.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>

namespace afterglow {
namespace {

using Json = nlohmann::ordered_json;

struct InfoCommand {
    std::string file;
    bool json = false;
};

Json info_json(const TransferFile& file) {
    const TransferOperator& transfer = file.transfer;
    Json levels = Json::array(), bytes = Json::object();
    for (int l = 0; l < transfer.points.levels(); ++l)
        levels.push_back({{"functions", transfer.points.end(l) - transfer.points.begin(l)},
                          {"spacing", transfer.points.spacing[static_cast<std::size_t>(l)]},
                          {"sender", l < transfer.sender_levels},
                          {"links", transfer.link_count(l)}});
    for (const auto& [name, count] : file.tensor_bytes)
        bytes[name] = count;
    return {{"version", file.provenance.version},
            {"scene", file.provenance.scene},
            {"scene_hash", file.provenance.scene_hash},
            {"seed", file.provenance.seed},
            {"operator", operator_name(transfer.kind)},
            {"receivers", transfer.points.size()},
            {"senders", transfer.senders()},
            {"bounces", transfer.bounces},
            {"links", transfer.link_count()},
            {"levels", levels},
            {"bytes", bytes},
            {"options", Json::parse(file.provenance.options)},
            {"statistics", Json::parse(file.provenance.statistics)}};
}

/// Bytes of all tensors whose names start with `prefix`.
std::uint64_t bytes_of(const TransferFile& file, const std::string& prefix) {
    std::uint64_t sum = 0;
    for (const auto& [name, count] : file.tensor_bytes)
        if (name.starts_with(prefix)) sum += count;
    return sum;
}

void print_text(const TransferFile& file) {
    const TransferOperator& transfer = file.transfer;
    const TransferProvenance& provenance = file.provenance;
    std::printf("scene       %s\n", provenance.scene.c_str());
    std::printf("hash        %s\n", provenance.scene_hash.c_str());
    std::printf("written by  afterglow %s\n", provenance.version.c_str());
    std::printf("options     %s\n", provenance.options.c_str());
    std::printf("operator    %s\n", operator_name(transfer.kind));
    std::printf("receivers   %u on %d levels\n", transfer.points.size(), transfer.points.levels());
    std::printf("senders     %u on %d levels\n", transfer.senders(), transfer.sender_levels);
    const auto megabytes = [&](const char* prefix) {
        return static_cast<double>(bytes_of(file, prefix)) * 1e-6;
    };
    std::printf("megabytes   %.2f: links %.2f, push %.2f, points %.2f\n", megabytes(""),
                megabytes("links.") + megabytes("solution."),
                megabytes("push.") + megabytes("pyramid."), megabytes("points."));
    const Json statistics = Json::parse(provenance.statistics);
    if (statistics.contains("verified")) {
        const Json& json = statistics["verified"];
        VerifiedError verified;
        verified.rel_rmse = json.value("rel_rmse", 0.0);
        verified.standard_error = json.value("standard_error", 0.0);
        verified.worst = json.value("worst", 0.0);
        verified.places = json.value("places", 0);
        verified.lights = json.value("lights", 0);
        std::printf("verified    %s\n", verified.text().c_str());
        if (const Json parts = json.value("parts", Json()); parts.is_object()) {
            const auto part = [&](const char* name) -> ErrorPart {
                const Json pair = parts.value(name, Json());
                return pair.is_array() && pair.size() == 2 ? ErrorPart{pair[0].get<double>(), pair[1].get<double>()} : ErrorPart{};
            };
            std::printf("of which    %s\n", ErrorParts{part("senders"), part("links"), part("receivers")}.text().c_str());
        }
    }
    std::printf("level  functions    spacing       links  links a function  megabytes of links\n");
    for (int l = 0; l < transfer.points.levels(); ++l) {
        const std::uint32_t functions = transfer.points.end(l) - transfer.points.begin(l);
        const std::uint64_t links = transfer.link_count(l);
        std::printf("%5d  %9u  %9.4g  %10llu  %16.1f  %18.2f\n", l, functions,
                    static_cast<double>(transfer.points.spacing[static_cast<std::size_t>(l)]),
                    static_cast<unsigned long long>(links),
                    static_cast<double>(links) / std::max(1u, functions),
                    1e-6 * static_cast<double>(transfer.link_bytes(l)));
    }
}

} // namespace

void add_info_command(CLI::App& app) {
    CLI::App* sub = app.add_subcommand("info", "What a transfer file holds");
    const auto command = std::make_shared<InfoCommand>();
    sub->add_option("file", command->file, "Transfer file")->required()->type_name("FILE");
    sub->add_flag("--json", command->json, "One JSON object instead of text");
    sub->callback([command] {
        const TransferFile file = load_transfer(command->file);
        if (command->json)
            std::printf("%s\n", info_json(file).dump().c_str());
        else
            print_text(file);
    });
}

} // namespace afterglow
