#include "transport/program.h"

#include "core/error.h"
#include "core/process_end.h"

#include <CLI/CLI.hpp>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <new>

namespace afterglow {
namespace {

/// Throws Error where something that was printed is lost.
void finish_stdout() {
    errno = 0;
    if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return;
    throw Error(std::string("standard output cannot be written")
                + (errno != 0 ? std::string(": ") + std::strerror(errno) : ""));
}

} // namespace

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& work) {
    const auto fail = [&](const char* what, int status, const char* remedy = "") {
        const std::string line = printable(what, std::string::npos);
        std::fprintf(stderr, "%s: %s%s\n", app.get_name().c_str(), line.c_str(), remedy);
        return status;
    };
    try {
        prepare_process(app.get_name());
        try {
            app.parse(argc, argv);
            work();
        } catch (const CLI::Success& help) {
            app.exit(help);
        }
        finish_stdout();
        return 0;
    } catch (const CLI::ParseError& error) {
        return fail(error.what(), 2, "; see --help");
    } catch (const UsageError& error) {
        return fail(error.what(), 2);
    } catch (const std::bad_alloc&) {
        return fail(out_of_memory, 1);
    } catch (const std::exception& error) {
        return fail(error.what(), 1);
    }
}

} // namespace afterglow
