#include "tests/stability/family.h"

#include "core/error.h"
#include "core/file.h"

#include <algorithm>
#include <cstdio>
#include <sstream>

namespace afterglow {

Figure percent(const std::string& name, double share) {
    return {name + " [%]", 100.0 * share};
}

void report(const Family& family, const std::string& folder) {
    std::printf("%s\n", family.name.c_str());
    std::fflush(stdout);
    std::ostringstream csv;
    bool is_first = true;
    for (const double value : family.values) {
        std::vector<Figure> figures;
        try {
            figures = family.measure(value);
        } catch (const Error& error) {
            std::printf("  %*.6g  %s\n", static_cast<int>(family.dial.size()), value, error.what());
            continue;
        }
        if (is_first) {
            std::printf("  %s", family.dial.c_str());
            csv << family.dial;
            for (const Figure& figure : figures) {
                std::printf("  %10s", figure.name.c_str());
                csv << ',' << figure.name;
            }
            std::printf("\n");
            csv << '\n';
            is_first = false;
        }
        std::printf("  %*.6g", static_cast<int>(family.dial.size()), value);
        csv << value;
        for (const Figure& figure : figures) {
            std::printf("  %*.4g", std::max(10, static_cast<int>(figure.name.size())),
                        figure.value);
            csv << ',' << figure.value;
        }
        std::printf("\n");
        csv << '\n';
        std::fflush(stdout);
    }
    if (folder.empty()) return;
    write_file(folder + "/" + family.name + ".csv", csv.str());
}

} // namespace afterglow
