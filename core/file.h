#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace afterglow {

/// Writes a file through `write(temporary_path)` beside its target and renames it over it when that
/// returns; on any failure nothing is left behind and a file that was there stays as it was. Throws
/// FileError where the rename or sync fails. A symbolic link is followed; a device is written to
/// directly. `write` must report its own errors (write_bytes() does).
void write_atomically(const std::string& path,
                      const std::function<void(const std::string& temporary_path)>& write);

/// Writes all bytes to a file or device, or throws FileError: a full disk does not go unnoticed.
/// Not atomic by itself: call it inside write_atomically().
void write_bytes(const std::string& path, std::span<const std::byte> bytes);

/// Writes a file that is in memory, whole or not at all. Throws FileError.
void write_file(const std::string& path, std::string_view content);

/// A whole file, mapped read-only. Throws FileError.
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
