#pragma once

#include "core/error.h"
#include "tests/support/temporary_folder.h"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

/// What each harness defines: it hands the bytes to one reader. libFuzzer calls it with what it makes up, or
/// with the files of a corpus.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace afterglow {

inline std::string text_of(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const char*>(data), size};
}

/// Where a harness puts what can only be read by its name.
inline const TemporaryFolder& input_folder() {
    static const TemporaryFolder folder;
    return folder;
}

/// Ends the process where a promise of a reader does not hold.
inline void require(bool holds, std::string_view promise) {
    if (holds) return;
    std::fprintf(stderr, "broken promise: %.*s\n", static_cast<int>(promise.size()), promise.data());
    std::abort();
}

/// Runs what may throw an Error, whose message must be one line of bounded length. Nothing else is caught: any other
/// exception ends the process, as does a crash.
template <class Action>
void accept_refusal(const Action& action) {
    try {
        action();
    } catch (const Error& error) {
        const std::string_view message = error.what();
        require(!message.empty() && message.size() < 4096, message);
        for (const unsigned char c : message)
            require(c >= 32 && c != 127, "a message is one line without control characters");
    }
}

} // namespace afterglow
