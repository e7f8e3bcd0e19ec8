#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace afterglow {

/// What main() returns: parses the command line, whose callbacks may do the work, then calls `work`. Errors
/// become one line on stderr and status 1, or 2 for wrong usage; so does a result that cannot be written to
/// stdout. prepare_process() tells how signals and want of memory end it. A pipe that nobody reads any
/// longer ends it without a word, as usual (SIGPIPE).
int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& work = [] {});

} // namespace afterglow
