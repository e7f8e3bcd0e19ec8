#include "tests/fuzz/harness.h"

#include <algorithm>
#include <vector>

/// Stands for libFuzzer where the compiler has none: every file of the folders that are named goes through
/// the harness once, in the order of the names, so that what was found once is not lost again.
int main(int argc, char** argv) {
    std::vector<std::filesystem::path> files;
    for (int i = 1; i < argc; ++i)
        for (const auto& entry : std::filesystem::directory_iterator(argv[i]))
            files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    for (const auto& file : files) {
        std::printf("%s\n", file.c_str());
        std::fflush(stdout); // the last name is that of the culprit
        const std::string bytes = afterglow::content_of(file.string());
        LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    }
    if (files.empty()) std::fprintf(stderr, "no files to replay\n");
    return files.empty() ? 1 : 0;
}
