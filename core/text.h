#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <system_error>

namespace afterglow {

inline constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";

/// Without blanks and line ends before and behind.
inline std::string_view trimmed(std::string_view text) {
    const auto begin = text.find_first_not_of(" \t\r\n");
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(" \t\r\n") - begin + 1);
}

/// Whether messages can repeat it: one line without control characters, neither empty nor beyond 4096 bytes.
inline bool is_line_of_text(std::string_view text) {
    constexpr std::size_t longest = 4096;
    return !text.empty() && text.size() <= longest
           && std::ranges::none_of(text, [](unsigned char c) { return c < 32 || c == 127; });
}

/// A number without the "+" before it, which from_chars() does not know; with it where another sign follows.
inline std::string_view without_plus(std::string_view text) {
    return text.starts_with('+') && !text.starts_with("+-") ? text.substr(1) : text;
}

/// Reads a text that is a finite number as a whole, "+" before it or not; what is too small for a float is zero.
inline bool parse_finite(std::string_view text, float& value) {
    text = without_plus(text);
    const char* const last = text.data() + text.size();
    std::from_chars_result read = std::from_chars(text.data(), last, value);
    if (read.ec == std::errc::result_out_of_range) {
        double precise = 0.0;
        read = std::from_chars(text.data(), last, precise);
        value = static_cast<float>(precise);
    }
    return read.ec == std::errc{} && read.ptr == last && std::isfinite(value);
}

} // namespace afterglow
