#pragma once

#include "transport/safetensors.h"
#include "transport/transfer_operator.h"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace afterglow {

/// What a transfer file says beside its numbers. The same for the same input, options and seed.
struct TransferProvenance {
    std::string version;    // of the program that wrote the file
    std::string scene;      // the scene's path as it can be opened from here, or builtin:NAME
    std::string scene_hash; // Scene::content_hash()
    std::uint64_t seed = 1;
    std::string options = "{}";    // JSON object: what was asked of precompute
    std::string statistics = "{}"; // JSON object: what came of it
};

/// A transfer file in memory. Links and push rows lie in the mapped file; copies share the map.
struct TransferFile {
    TransferOperator transfer;
    TransferProvenance provenance;
    std::vector<std::pair<std::string, std::uint64_t>> tensor_bytes; // by name, in the file's order
};

inline constexpr const char* transfer_format = "afterglow transfer"; // of operators that are finished

/// Writes the file that docs/transfer-format.md describes; it appears whole or not at all. The
/// scene's path is kept relative to the file's folder. Returns the file's bytes. Throws FileError. A file of
/// another `format` may hold further tensors.
std::uint64_t save_transfer(const std::string& path, const TransferOperator& transfer,
                            const TransferProvenance& provenance, const std::string& format = transfer_format,
                            const std::vector<Tensor>& further = {});

/// What a file keeps of a scene's path: relative to the file's folder. Only the scene's own folder is resolved, as
/// the files that an OBJ file names are sought beside it, not beside what it may be a link to.
std::string stored_scene_path(const std::string& file, const std::string& scene);

/// Maps a file and checks everything that the computation relies on: sizes, offsets, sorted indices
/// in range, finite values, unit normals. Takes one pass over the file. Throws FileError, also where the
/// file is of another format.
TransferFile load_transfer(const std::string& path, const std::string& format = transfer_format);

/// The scene that a file was made from: from `override_path` where that is not empty, else from
/// where the file says. Throws FileError where it is not there or its content has changed.
Scene load_transfer_scene(const std::string& path, const TransferProvenance& provenance,
                          const std::string& override_path = "");

} // namespace afterglow
