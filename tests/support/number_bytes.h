#pragma once

#include <cstdint>
#include <string>

namespace afterglow {

/// The four bytes of a number in a file, the largest first.
inline std::string big_endian(std::uint32_t number) {
    std::string bytes(4, '\0');
    for (std::size_t i = 0; i < 4; ++i)
        bytes[i] = static_cast<char>(number >> (24 - 8 * i));
    return bytes;
}

/// The same, the smallest first.
inline std::string little_endian(std::uint32_t number) {
    const std::string bytes = big_endian(number);
    return {bytes.rbegin(), bytes.rend()};
}

} // namespace afterglow
