#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace afterglow {

/// Where what is written under a name goes: symbolic links are followed, also to what is not there yet.
struct OutputTarget {
    std::string path;
    std::optional<int> descriptor; // where the name is that of an open file of this process, as /dev/stdout is
};
OutputTarget output_target(const std::string& path);

/// A file that is being written.
class OutputFile {
public:
    /// All of it, or throws FileError: a full disk does not go unnoticed.
    void write(std::span<const std::byte> bytes);

private:
    friend void write_atomically(const std::string& path, const std::function<void(OutputFile&)>& write);
    OutputFile(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
    std::string path_; // that it will have
    int descriptor_;
};

/// Writes a file beside its target, asks for it to be on disk (fsync) and renames it over the target; on
/// any failure, and where the process ends early, nothing is left behind and a file that was there stays
/// as it was. Only SIGKILL or a crash of the machine leaves what was written so far, under the name
/// TARGET.part-PROCESS-NUMBER, and the next to write the target removes it. Throws FileError. A symbolic
/// link is followed; a device, a pipe and what the process has open (/dev/stdout, /dev/fd/3) are written to directly.
void write_atomically(const std::string& path, const std::function<void(OutputFile&)>& write);

/// Writes a file that is in memory, whole or not at all. Throws FileError.
void write_file(const std::string& path, std::string_view content);

/// Makes a folder, and those it lies in, where it is not there. Throws FileError.
void make_folder(const std::string& path);

/// A whole file, mapped read-only. Throws FileError where that is the file's fault, Error where too many are open,
/// std::bad_alloc where there is no room for it. It must not be cut short by others while it is in use (process_end.h).
class MappedFile {
public:
    explicit MappedFile(const std::string& path);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;
    std::span<const std::byte> bytes() const { return {data_, size_}; }

private:
    const std::byte* data_ = nullptr;
    std::size_t size_ = 0;
};

/// XXH3 of some bytes, 128 bits as 32 hexadecimal digits; `content_hash` and file checksums use it.
std::string hash_hex(std::span<const std::byte> bytes);

} // namespace afterglow
