#include "core/file.h"

#include "core/error.h"

#include <xxhash.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace afterglow {
namespace {

/// Closes its file descriptor when it goes out of scope.
class Descriptor {
public:
    Descriptor(const std::string& path, int flags)
        : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    explicit operator bool() const { return fd_ >= 0; }
    operator int() const { return fd_; }
    /// False where the operating system reports a late write error.
    bool close() { return ::close(std::exchange(fd_, -1)) == 0; }

private:
    int fd_;
};

std::string reason() {
    return std::strerror(errno);
}

/// Removes a file that was not renamed away.
struct TemporaryFile {
    std::string path;
    ~TemporaryFile() { ::unlink(path.c_str()); }
};

std::string temporary_beside(const std::string& target) {
    static std::atomic<unsigned> counter{0};
    return target + ".part-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
}

/// The file that a path stands for once symbolic links are followed.
std::string behind_links(const std::string& path) {
    std::error_code ignored;
    if (!std::filesystem::is_symlink(path, ignored)) return path;
    const auto resolved = std::filesystem::weakly_canonical(path, ignored);
    return ignored ? path : resolved.string();
}

} // namespace

void write_atomically(const std::string& path,
                      const std::function<void(const std::string& temporary_path)>& write) {
    const std::string target = behind_links(path);
    struct stat status {};
    if (::stat(target.c_str(), &status) == 0) {
        if (S_ISDIR(status.st_mode)) throw FileError(path, "is a directory; name a file in it");
        // A device or pipe is written to, never replaced.
        if (!S_ISREG(status.st_mode)) return write(target);
    }

    const TemporaryFile temporary{temporary_beside(target)};
    write(temporary.path);
    {
        Descriptor written(temporary.path, O_RDONLY);
        if (!written) throw FileError(path, "was not written: " + reason());
        if (::fsync(written) != 0) throw FileError(path, "cannot be written to disk: " + reason());
    }
    if (::rename(temporary.path.c_str(), target.c_str()) != 0)
        throw FileError(path, "cannot be replaced: " + reason());

    // The rename itself lasts once its folder is on disk; a file system that cannot say so is no
    // fault.
    const std::string folder = std::filesystem::path(target).parent_path().string();
    const Descriptor directory(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY);
    if (directory) ::fsync(directory);
}

void write_bytes(const std::string& path, std::span<const std::byte> bytes) {
    Descriptor file(path, O_WRONLY | O_CREAT | O_TRUNC);
    if (!file) throw FileError(path, "cannot be created: " + reason());
    while (!bytes.empty()) {
        const ssize_t count = ::write(file, bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) throw FileError(path, "cannot be written: " + reason());
        bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
    if (!file.close()) throw FileError(path, "cannot be written: " + reason());
}

void write_file(const std::string& path, std::string_view content) {
    write_atomically(path, [&](const std::string& temporary) {
        write_bytes(temporary, std::as_bytes(std::span(content)));
    });
}

MappedFile::MappedFile(const std::string& path) {
    const Descriptor file(path,
                          O_RDONLY | O_NONBLOCK); // opening a pipe must not wait for its writer
    struct stat status {};
    if (!file || ::fstat(file, &status) != 0) throw FileError(path, "cannot be read: " + reason());
    if (!S_ISREG(status.st_mode)) throw FileError(path, "is not a regular file");
    size_ = static_cast<std::size_t>(status.st_size);
    if (size_ == 0) return; // nothing to map
    void* data = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
    if (data == MAP_FAILED) throw FileError(path, "cannot be mapped into memory: " + reason());
    data_ = static_cast<const std::byte*>(data);
}

MappedFile::~MappedFile() {
    if (data_) ::munmap(const_cast<std::byte*>(data_), size_);
}

std::string hash_hex(std::span<const std::byte> bytes) {
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, XXH3_128bits(bytes.data(), bytes.size()));
    constexpr char digits[] = "0123456789abcdef";
    std::string hex;
    for (const unsigned char byte : canonical.digest) {
        hex += digits[byte >> 4];
        hex += digits[byte & 15];
    }
    return hex;
}

} // namespace afterglow
