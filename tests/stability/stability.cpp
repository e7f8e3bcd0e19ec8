#include "core/error.h"
#include "tests/stability/family.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>

// The scenes where the method fails, and by how much: error against a dial, family by family. By
// hand: afterglow_stability [FAMILY ...] [--csv FOLDER]; without a family, all of them.

namespace afterglow {
namespace {

struct Arguments {
    std::vector<std::string> names; // empty: all
    std::string folder;             // empty: no files
};

Arguments parse(int argc, char** argv) {
    Arguments arguments;
    for (int i = 1; i < argc; ++i) {
        const std::string text = argv[i];
        if (text == "--csv") {
            if (++i == argc) throw UsageError("--csv needs a folder");
            arguments.folder = argv[i];
        } else {
            arguments.names.push_back(text);
        }
    }
    return arguments;
}

std::vector<Family> choose(std::vector<Family> families, const std::vector<std::string>& names) {
    if (names.empty()) return families;
    std::vector<Family> chosen;
    for (const std::string& name : names) {
        const auto found = std::ranges::find(families, name, &Family::name);
        if (found == families.end()) {
            std::string known;
            for (const Family& family : families)
                known += (known.empty() ? "" : ", ") + family.name;
            throw UsageError("there is no family '" + name + "', but " + known);
        }
        chosen.push_back(*found);
    }
    return chosen;
}

void run(const Arguments& arguments) {
    std::vector<Family> all = geometry_families();
    for (const std::vector<Family>& more : {light_families(), input_families()})
        all.insert(all.end(), more.begin(), more.end());
    const std::vector<Family> families = choose(std::move(all), arguments.names);
    if (!arguments.folder.empty()) std::filesystem::create_directories(arguments.folder);
    for (const Family& family : families)
        report(family, arguments.folder);
}

} // namespace
} // namespace afterglow

int main(int argc, char** argv) {
    try {
        afterglow::run(afterglow::parse(argc, argv));
        return 0;
    } catch (const afterglow::UsageError& error) {
        std::fprintf(stderr, "afterglow_stability: %s\n", error.what());
        return 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "afterglow_stability: %s\n", error.what());
        return 1;
    }
}
