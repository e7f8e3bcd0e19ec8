#include "transport/processor.h"

#ifdef AFTERGLOW_FAST_FOLDER // in the portable of two variants alone

#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <unistd.h>

namespace afterglow {
namespace {

bool is_fast_processor() {
    __builtin_cpu_init();
#ifdef __clang__ // does not know the level by its name; processors with these four have the rest as well
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")
           && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
#else
    return __builtin_cpu_supports("x86-64-v3");
#endif
}

} // namespace

void run_faster_twin(char** argv) {
    const char* kept = std::getenv("AFTERGLOW_PORTABLE");
    if ((kept && std::string_view(kept) == "1") || !is_fast_processor()) return;
    std::error_code failed;
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", failed);
    if (failed) return;
    const std::filesystem::path twin = self.parent_path() / AFTERGLOW_FAST_FOLDER / self.filename();
    execv(twin.c_str(), argv); // returns only where there is no twin
}

} // namespace afterglow

#else

namespace afterglow {
void run_faster_twin(char**) {}
} // namespace afterglow

#endif
