#include "core/file.h"
#include "core/process_end.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <unistd.h>

namespace afterglow {
namespace {

/// Half of a file, and no more of it for a minute.
void write_half(const std::string& path, int signal) {
    if (signal != SIGKILL) std::signal(signal, SIG_DFL); // whoever runs this may ignore it (nohup)
    prepare_process("writer");
    const AtEarlyEnd note([] {}, "so it was");
    write_atomically(path, [&](OutputFile& file) {
        file.write(std::as_bytes(std::span("half of it", 10)));
        std::raise(signal);
        std::this_thread::sleep_for(std::chrono::minutes(1));
    });
}

// Death tests in processes that are forked: they share the folder.

TEST(EarlyEnd, BySignalSaysSoAndLeavesNoUnfinishedFile) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a", "old");
    EXPECT_EXIT(write_half(path, SIGINT), ::testing::ExitedWithCode(130), "^writer: interrupted; so it was\n$");
    EXPECT_EXIT(write_half(path, SIGTERM), ::testing::ExitedWithCode(143), "^writer: ended by SIGTERM; so it was\n$");
    EXPECT_EXIT(write_half(path, SIGHUP), ::testing::ExitedWithCode(129), "^writer: ended by SIGHUP; so it was\n$");
    EXPECT_EQ(content_of(path), "old");
    EXPECT_EQ(folder.count(), 1u);
}

TEST(EarlyEnd, AfterSigkillTheUnfinishedFileGoesWithTheNextOne) {
    const TemporaryFolder folder;
    const std::string path = folder.path("a");
    EXPECT_EXIT(write_half(path, SIGKILL), ::testing::KilledBySignal(SIGKILL), "");
    EXPECT_FALSE(std::filesystem::exists(path));
    EXPECT_EQ(folder.count(), 1u);
    write_file(path, "new");
    EXPECT_EQ(content_of(path), "new");
    EXPECT_EQ(folder.count(), 1u);
}

TEST(EarlyEnd, DoesNotFollowASignalThatIsIgnoredFromTheStart) {
    EXPECT_EXIT(
        {
            std::signal(SIGHUP, SIG_IGN);
            prepare_process("patient");
            std::raise(SIGHUP);
            std::_Exit(7);
        },
        ::testing::ExitedWithCode(7), "");
}

TEST(EarlyEnd, ByAnExceptionThatLeavesAThreadIsOneLineAndStatusOne) {
    const auto throw_in_thread = [](auto exception) {
        prepare_process("thrower");
        std::thread([&] { throw exception; }).join();
    };
    EXPECT_EXIT(throw_in_thread(std::bad_alloc()), ::testing::ExitedWithCode(1), "^thrower: there is not enough memory");
    EXPECT_EXIT(throw_in_thread(std::runtime_error("out of ideas")), ::testing::ExitedWithCode(1),
                "^thrower: out of ideas\n$");
}

TEST(EarlyEnd, ByAFileThatIsCutShortInUseIsOneLineAndStatusOne) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a", std::string(1 << 20, 'a'));
    EXPECT_EXIT(
        {
            prepare_process("reader");
            const MappedFile file(path);
            std::filesystem::resize_file(path, 1);
            std::_Exit(file.bytes()[1 << 19] == std::byte{'a'} ? 7 : 8);
        },
        ::testing::ExitedWithCode(1), "^reader: a file was cut short, or could not be read, while it was in use\n$");
}

TEST(PrepareProcess, KeepsFilesOutOfClosedStandardStreams) {
    const TemporaryFolder folder;
    const std::string path = folder.path("a");
    EXPECT_EXIT(
        {
            ::close(STDOUT_FILENO);
            prepare_process("closed");
            write_atomically(path, [](OutputFile&) { std::_Exit(::write(STDOUT_FILENO, "result", 6) < 0 ? 0 : 1); });
        },
        ::testing::ExitedWithCode(0), "");
}

} // namespace
} // namespace afterglow
