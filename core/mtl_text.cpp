#include "core/mtl_text.h"

#include "core/text.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <vector>

namespace afterglow {
namespace {

/// What comes before the next blank, which goes with it.
std::string_view take_word(std::string_view& line) {
    line = trimmed(line);
    const std::string_view word = line.substr(0, line.find_first_of(" \t"));
    line.remove_prefix(word.size());
    return word;
}

bool is_number(std::string_view word) {
    if (word.starts_with('+')) word.remove_prefix(1);
    double value = 0.0;
    return !word.empty() && std::from_chars(word.data(), word.data() + word.size(), value).ptr == word.data() + word.size();
}

/// The numbers that come next, at most so many.
std::vector<std::string_view> take_numbers(std::string_view& line, std::size_t most) {
    std::vector<std::string_view> numbers;
    while (numbers.size() < most) {
        std::string_view rest = line;
        const std::string_view word = take_word(rest);
        if (!is_number(word)) break;
        numbers.push_back(word);
        line = rest;
    }
    return numbers;
}

/// A texture's line whose options of three numbers have three.
std::string with_whole_options(std::string_view line) {
    std::string result;
    while (!trimmed(line).empty()) {
        std::string_view rest = line;
        const std::string_view word = take_word(rest);
        if (word != "-o" && word != "-s" && word != "-t") { // as it stands, blanks and all
            result.append(line.data(), rest.data());
            line = rest;
            continue;
        }
        line = rest;
        std::vector<std::string_view> numbers = take_numbers(line, 3);
        numbers.resize(3, word == "-s" ? "1" : "0");
        result.append(" ").append(word);
        for (const std::string_view number : numbers) result.append(" ").append(number);
    }
    return result;
}

} // namespace

std::string mtl_for_tinyobj(std::string_view text) {
    if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
    std::string result;
    bool has_reflectance = false, has_texture = false; // of the material that is being read
    const auto end_material = [&] {
        if (has_texture && !has_reflectance) result += "Kd 0.999 0.999 0.999\n"; // the most there is
        has_reflectance = has_texture = false;
    };
    while (!text.empty()) {
        const std::string_view line = text.substr(0, text.find_first_of("\r\n"));
        text.remove_prefix(std::min(line.size() + 1, text.size()));
        std::string_view rest = line;
        const std::string_view word = take_word(rest);
        if (word == "newmtl") {
            end_material();
            std::string name(trimmed(rest));
            std::replace(name.begin(), name.end(), ' ', mtl_blank_in_name);
            result.append("newmtl ").append(name);
        } else if (word == "Kd") {
            has_reflectance = true;
            const std::vector<std::string_view> numbers = take_numbers(rest, 3);
            result += numbers.size() == 1 ? "Kd" : line;
            if (numbers.size() == 1)
                for (int k = 0; k < 3; ++k) result.append(" ").append(numbers[0]);
        } else if (word.starts_with("map_") || word == "bump" || word == "norm") {
            has_texture = has_texture || word == "map_Kd";
            result += with_whole_options(line);
        } else {
            result += line;
        }
        result += '\n';
    }
    end_material();
    return result;
}

} // namespace afterglow
