#pragma once

#include <stdexcept>
#include <string>

namespace afterglow {

/// Text out of a file or off the command line, for a message of one short line: control characters
/// become '?', what is long is cut.
inline std::string printable(std::string text, std::size_t longest = 64) {
    if (text.size() > longest) text = text.substr(0, longest) + "...";
    for (char& c : text)
        if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';
    return text;
}

/// A fault of the world (file, option, device), told in one line: what, where, remedy.
/// Only main() catches it; exit status 1.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// A fault of a file; the message starts with its path.
class FileError : public Error {
public:
    FileError(const std::string& path, const std::string& what) : Error(path + ": " + what) {}
};

/// The command line asks for something impossible; exit status 2.
class UsageError : public Error {
public:
    using Error::Error;
};

} // namespace afterglow
