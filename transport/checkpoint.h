#pragma once

#include "transport/precompute.h"
#include "transport/transfer_file.h"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace afterglow {

/// The state of a precomputation in a file, from which another process goes on and ends with the same bytes:
/// the basis, the links of the first receivers, and which sender rows were made on the way. It lies in the
/// container of a transfer file (docs/transfer-format.md) under a format name of its own. The pushed rows of
/// receivers and the sender rows themselves are larger than what they are made from, and made again.
class Checkpoint {
public:
    struct State {
        TransferOperator transfer; // its sender areas are zero, its links those of receivers before `done`
        std::uint32_t done = 0;
        std::vector<std::uint32_t> made_rows; // SenderRows::made_numbers()
        PrecomputeReport report;              // counts alone
    };

    /// Reads the file where there is one. Throws FileError where it is damaged, or where its version, scene
    /// hash, seed or options are not those that are `asked` for.
    Checkpoint(std::string path, TransferProvenance asked, double seconds_between);

    const std::string& path() const { return path_; }
    /// What was found, until it is taken.
    const std::optional<State>& found() const { return found_; }

    /// At the start of a precomputation: what was found, if it is of this spacing. A search for the spacing
    /// goes from coarse to fine, and its first steps, which take a small part of its time, are made again:
    /// while they are, what was found of a finer one stays, and save() does nothing.
    std::optional<State> take(float coarse_scale);

    /// Whether it is time to save: as many seconds as were asked for have passed since the last time, and
    /// a hundred times as long as that took; of 0 seconds, always.
    bool is_due() const;
    /// Replaces the file. Throws FileError.
    void save(const TransferOperator& transfer, std::uint32_t done,
              const std::vector<std::uint32_t>& made_rows, const PrecomputeReport& report);
    /// When all is done.
    void remove();

private:
    std::string path_;
    TransferProvenance asked_;
    double seconds_between_, save_seconds_ = 0.0;
    std::chrono::steady_clock::time_point saved_ = std::chrono::steady_clock::now();
    std::optional<State> found_;
    float found_scale_ = 0.0f, scale_ = 1.0f; // coarse_scale of the file, and of what is computed now

    void read();
};

} // namespace afterglow
