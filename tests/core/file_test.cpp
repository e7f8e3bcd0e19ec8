#include "core/error.h"
#include "core/file.h"
#include "tests/support/temporary_folder.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

namespace afterglow {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
    return std::as_bytes(std::span(text));
}

void write_text(const std::string& path, const std::string& text) {
    write_atomically(path, [&](OutputFile& file) { file.write(bytes_of(text)); });
}

/// Files of this process may not grow beyond some bytes, as if the disk were full.
class FullDisk {
public:
    explicit FullDisk(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
        getrlimit(RLIMIT_FSIZE, &before_);
        rlimit limit = before_;
        limit.rlim_cur = bytes;
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~FullDisk() {
        setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }

private:
    rlimit before_{};
    void (*handler_)(int);
};

TEST(WriteAtomically, ReplacesAFileAndLeavesNothingElse) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a.txt", "old");
    write_text(path, "new");
    EXPECT_EQ(content_of(path), "new");
    EXPECT_EQ(folder.count(), 1u);
}

TEST(WriteAtomically, KeepsTheOldFileWhereTheWriterThrows) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a.txt", "old");
    EXPECT_THROW(write_atomically(path,
                                  [](OutputFile& file) {
                                      file.write(bytes_of("half of it"));
                                      throw std::runtime_error("out of ideas");
                                  }),
                 std::runtime_error);
    EXPECT_EQ(content_of(path), "old");
    EXPECT_EQ(folder.count(), 1u);
}

TEST(WriteAtomically, KeepsTheOldFileWhereTheDiskIsFull) {
    const TemporaryFolder folder;
    const std::string path = folder.write("a.txt", "old");
    {
        const FullDisk disk(1000);
        EXPECT_THROW(write_text(path, std::string(5000, 'x')), FileError);
    }
    EXPECT_EQ(content_of(path), "old");
    EXPECT_EQ(folder.count(), 1u);
}

TEST(WriteAtomically, TellsOfAFullDeviceAndDoesNotReplaceIt) {
    if (!std::filesystem::is_character_file("/dev/full")) GTEST_SKIP() << "no /dev/full here";
    EXPECT_THROW(write_text("/dev/full", "text"), FileError);
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(WriteAtomically, WritesThroughASymbolicLink) {
    const TemporaryFolder folder;
    const std::string target = folder.write("target.txt", "old"), link = folder.path("link.txt");
    std::filesystem::create_symlink(target, link);
    write_text(link, "new");
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    EXPECT_EQ(content_of(target), "new");
}

TEST(WriteAtomically, WritesThroughALinkToWhatIsNotThereYet) {
    const TemporaryFolder folder;
    std::filesystem::create_symlink("target.txt", folder.path("one.txt"));
    std::filesystem::create_symlink(folder.path("one.txt"), folder.path("two.txt"));
    write_text(folder.path("two.txt"), "new");
    EXPECT_TRUE(std::filesystem::is_symlink(folder.path("one.txt")));
    EXPECT_TRUE(std::filesystem::is_symlink(folder.path("two.txt")));
    EXPECT_EQ(content_of(folder.path("target.txt")), "new");
    std::filesystem::create_symlink("ring.txt", folder.path("ring.txt"));
    EXPECT_THROW(write_text(folder.path("ring.txt/a.txt"), "text"), FileError);
}

TEST(WriteAtomically, WritesToWhatTheProcessHasOpen) {
    // As a shell hands over "program -o /dev/stdout >> all.txt": what is there stays.
    const TemporaryFolder folder;
    const std::string path = folder.write("all.txt", "first ");
    const int open = ::open(path.c_str(), O_WRONLY | O_APPEND);
    ASSERT_GE(open, 0);
    const std::string number = std::to_string(open);
    std::filesystem::create_symlink("/dev/fd/" + number, folder.path("link"));
    write_text("/dev/fd/" + number, "second ");
    write_text("/proc/self/fd/" + number, "third ");
    write_text(folder.path("link"), "fourth");
    ::close(open);
    EXPECT_EQ(content_of(path), "first second third fourth");
    EXPECT_THROW(write_text("/dev/fd/" + number, "text"), FileError); // it is closed now
    EXPECT_EQ(folder.count(), 2u);
}

TEST(WriteAtomically, LeavesAFileToThoseWhoMayReadIt) {
    const TemporaryFolder folder;
    const std::string path = folder.write("private.txt", "old");
    namespace fs = std::filesystem;
    fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
    write_text(path, "new");
    EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST(WriteAtomically, RefusesAFolderAndAMissingFolder) {
    const TemporaryFolder folder;
    EXPECT_THROW(write_text(folder.path(""), "text"), FileError);
    EXPECT_THROW(write_text(folder.path("none/a.txt"), "text"), FileError);
    EXPECT_EQ(folder.count(), 0u);
}

TEST(WriteAtomically, RemovesWhatAKilledProcessLeftOfItsTargetAlone) {
    const TemporaryFolder folder;
    const std::string path = folder.path("a.txt");
    folder.write("a.txt.part-123-0", "half of it");
    folder.write("b.txt.part-123-0", "another target's");
    folder.write("a.txt.part-of-mine", "somebody's own file");
    folder.write("a.txt.part-00", "what split -d makes of it");
    write_text(path, "new");
    EXPECT_EQ(content_of(path), "new");
    EXPECT_FALSE(std::filesystem::exists(folder.path("a.txt.part-123-0")));
    EXPECT_EQ(folder.count(), 4u);
}

TEST(WriteAtomically, TwoAtATimeDoNotDisturbEachOther) {
    const TemporaryFolder folder;
    const std::string path = folder.path("a.txt");
    write_atomically(path, [&](OutputFile& outer) {
        outer.write(bytes_of("outer"));
        write_text(path, "inner");
        EXPECT_EQ(content_of(path), "inner");
        outer.write(bytes_of(", still there"));
    });
    EXPECT_EQ(content_of(path), "outer, still there");
    EXPECT_EQ(folder.count(), 1u);
}

TEST(MappedFile, ShowsTheBytesOfAFile) {
    const TemporaryFolder folder;
    const std::string text("a\0b\n", 4);
    const MappedFile file(folder.write("a.bin", text));
    ASSERT_EQ(file.bytes().size(), text.size());
    EXPECT_EQ(std::memcmp(file.bytes().data(), text.data(), text.size()), 0);
}

TEST(MappedFile, OfAnEmptyFileIsEmpty) {
    const TemporaryFolder folder;
    EXPECT_TRUE(MappedFile(folder.write("empty", "")).bytes().empty());
}

TEST(MappedFile, RefusesWhatIsNoFile) {
    const TemporaryFolder folder;
    EXPECT_THROW(MappedFile(folder.path("none")), FileError);
    EXPECT_THROW(MappedFile(folder.path("")), FileError);
    EXPECT_THROW(MappedFile("/dev/null"), FileError);
}

TEST(HashHex, IsTheCanonicalXxh3Of128Bits) {
    // Published test value: XXH3 128 bits of no bytes, seed 0.
    EXPECT_EQ(hash_hex({}), "99aa06d3014798d86001c324468d497f");
    EXPECT_NE(hash_hex(bytes_of("a")), hash_hex(bytes_of("b")));
}

} // namespace
} // namespace afterglow
