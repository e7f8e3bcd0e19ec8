#pragma once

#include <string>

namespace CLI {
class App;
}

namespace afterglow {

/// What a program's option tables do not say.
struct ManualText {
    std::string description; // paragraphs with an empty line between them
    std::string see_also;    // other pages, such as "afterglow-view(1)"
};

// What an option takes is read from the name of its type: FILE, FOLDER and SCENE (a file or a built-in
// scene) are completed from the disk, a|b|c and the members of CLI::IsMember are a choice of words.

/// The page for man(1), in roff: the program, its subcommands, and each option that --help shows.
std::string man_page(const CLI::App& app, const ManualText& text);

/// A script for bash that completes subcommands, options, choices and files.
std::string bash_completion(const CLI::App& app);

/// --manual and --completion, which print the two and end the program.
void add_manual_options(CLI::App& app, const ManualText& text);

} // namespace afterglow
