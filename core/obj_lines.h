#pragma once

#include <streambuf>
#include <string>
#include <string_view>

namespace afterglow {

/// Hands an OBJ file in memory to tinyobjloader line by line, in words that it understands as the format means
/// them:
///  - a byte order mark is left out, a line that ends in a backslash is joined with the next;
///  - a face ends at a comment;
///  - what is no number ("nan", "-inf", "1.#IND"), a plausible zero there, becomes 1e999, hence infinite: so
///    triangles that use it can be told;
///  - an index of ten digits or more, which might come out as a small one, becomes 0, which is no index.
class ObjLines : public std::streambuf {
public:
    /// Keeps the view.
    explicit ObjLines(std::string_view text);

    /// The line that is being read.
    std::string_view line() const { return line_; }

private:
    int_type underflow() override;
    std::string_view take_line();

    std::string_view rest_, line_;
    std::string joined_, rewritten_;
};

} // namespace afterglow
