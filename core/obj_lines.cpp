#include "core/obj_lines.h"

#include "core/text.h"

#include <algorithm>
#include <cstddef>

namespace afterglow {
namespace {

constexpr std::size_t index_digits = 9; // tinyobjloader reads indices as int

bool is_number_character(char c) {
    return (c >= '0' && c <= '9') || c == '+' || c == '-' || c == '.' || c == 'e' || c == 'E';
}
bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }
/// Where the numbers of a line "v ...", "vn ..." or "vt ..." begin; 0 for other lines.
std::size_t start_of_numbers(std::string_view line) {
    std::size_t i = 0;
    while (i < line.size() && is_space(line[i]))
        ++i;
    if (i == line.size() || line[i] != 'v') return 0;
    ++i;
    if (i < line.size() && (line[i] == 'n' || line[i] == 't')) ++i;
    return i < line.size() && is_space(line[i]) ? i : 0;
}
bool has_odd_number(std::string_view line) {
    const std::size_t start = start_of_numbers(line);
    if (start == 0) return false;
    return !std::all_of(line.begin() + static_cast<std::ptrdiff_t>(start), line.end(),
                        [](char c) { return is_number_character(c) || is_space(c); });
}
std::string with_infinities(std::string_view line) {
    std::size_t i = start_of_numbers(line);
    std::string result(line.substr(0, i));
    while (i < line.size()) {
        const std::size_t begin = i;
        while (i < line.size() && !is_space(line[i]))
            ++i;
        const std::string_view token = line.substr(begin, i - begin);
        const bool is_number = std::all_of(token.begin(), token.end(), is_number_character);
        result += is_number ? token : std::string_view("1e999");
        if (i < line.size()) result += line[i++];
    }
    return result;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_face(std::string_view line) {
    const std::size_t start = line.find_first_not_of(" \t");
    return start != std::string_view::npos && line[start] == 'f';
}
bool has_absurd_index(std::string_view line) {
    std::size_t run = 0;
    for (const char c : line)
        if ((run = is_digit(c) ? run + 1 : 0) > index_digits) return true;
    return false;
}
std::string without_absurd_indices(std::string_view line) {
    std::string result;
    for (std::size_t i = 0; i < line.size();) {
        std::size_t end = i;
        while (end < line.size() && is_digit(line[end]))
            ++end;
        if (end == i) ++end; // a single character that is no digit
        result += end - i > index_digits ? "0" : line.substr(i, end - i);
        i = end;
    }
    return result;
}

/// Whether a line goes on in the next; a comment does not.
bool goes_on(std::string_view line) {
    line = trimmed(line);
    return line.ends_with('\\') && !line.starts_with('#');
}

} // namespace

ObjLines::ObjLines(std::string_view text) : rest_(text) {
    if (rest_.starts_with(byte_order_mark)) rest_.remove_prefix(byte_order_mark.size());
}

std::string_view ObjLines::take_line() {
    std::size_t length = 0; // find_first_of() would call a function for each character
    while (length < rest_.size() && rest_[length] != '\n' && rest_[length] != '\r') ++length;
    length = std::min(length + (rest_.substr(length, 2) == "\r\n" ? 2 : 1), rest_.size());
    const std::string_view line = rest_.substr(0, length);
    rest_.remove_prefix(length);
    return line;
}

ObjLines::int_type ObjLines::underflow() {
    if (rest_.empty()) return traits_type::eof();
    line_ = take_line();
    if (goes_on(line_)) {
        joined_ = line_;
        while (goes_on(joined_)) {
            joined_.resize(joined_.rfind('\\'));
            joined_ += ' ';
            joined_ += take_line();
        }
        line_ = joined_;
    }
    std::string_view shown = line_;
    if (has_odd_number(line_)) {
        rewritten_ = with_infinities(line_);
        shown = rewritten_;
    } else if (is_face(line_)) {
        if (const std::size_t comment = line_.find('#'); comment != std::string_view::npos) {
            rewritten_ = line_.substr(0, comment);
            rewritten_ += '\n';
            shown = rewritten_;
        }
        if (has_absurd_index(shown)) {
            rewritten_ = without_absurd_indices(shown);
            shown = rewritten_;
        }
    }
    char* begin = const_cast<char*>(shown.data()); // the base class reads only
    setg(begin, begin, begin + shown.size());
    return traits_type::to_int_type(*begin);
}

} // namespace afterglow
