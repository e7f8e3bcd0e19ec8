#include "core/file.h"

#include "core/error.h"
#include "core/process_end.h"

#include <xxhash.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <new>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace afterglow {
namespace {

/// Closes its file descriptor when it goes out of scope.
class Descriptor {
public:
    Descriptor() = default;
    Descriptor(const std::string& path, int flags)
        : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Descriptor& operator=(Descriptor&& other) noexcept {
        std::swap(fd_, other.fd_);
        return *this;
    }
    /// One more of an open file of this process; none where there is none of that number.
    static Descriptor copy_of(int number) {
        Descriptor copy;
        copy.fd_ = ::fcntl(number, F_DUPFD_CLOEXEC, 0);
        return copy;
    }
    explicit operator bool() const { return fd_ >= 0; }
    operator int() const { return fd_; }
    /// False where the operating system reports a late write error.
    bool close() { return ::close(std::exchange(fd_, -1)) == 0; }

private:
    int fd_ = -1;
};

std::string reason() {
    return std::strerror(errno);
}

std::filesystem::path folder_of(const std::string& path) {
    const auto folder = std::filesystem::path(path).parent_path();
    return folder.empty() ? "." : folder;
}

constexpr const char* unfinished_mark = ".part-";

/// A new file beside its target, which goes away unless it is renamed. It is locked while it is
/// written: so another process can tell it from one that was left behind.
class UnfinishedFile {
public:
    explicit UnfinishedFile(const std::string& target) {
        static std::atomic<unsigned> counter{0};
        do {
            {
                const auto hold = hold_off_early_end();
                path_ = target + unfinished_mark + std::to_string(::getpid()) + "-" + std::to_string(counter++);
                file_ = Descriptor(path_, O_WRONLY | O_CREAT | O_EXCL);
                exists_ = static_cast<bool>(file_);
            }
            // EEXIST: of a process with our number, that was killed or lives on another machine.
            if (!file_ && errno != EEXIST) throw FileError(target, "cannot be created: " + reason());
        } while (!file_ || !lock());
    }
    ~UnfinishedFile() { remove(); }
    UnfinishedFile(const UnfinishedFile&) = delete;
    UnfinishedFile& operator=(const UnfinishedFile&) = delete;

    int descriptor() const { return file_; }

    void rename_to(const std::string& target, const std::string& path) {
        if (::fsync(file_) != 0) throw FileError(path, "cannot be written to disk: " + reason());
        const auto hold = hold_off_early_end();
        if (::rename(path_.c_str(), target.c_str()) != 0)
            throw FileError(path, "cannot be replaced: " + reason());
        exists_ = false;
    }

private:
    /// False where it was taken for left behind, and removed, before it was locked. A file system
    /// that knows no locks has none to lose.
    bool lock() {
        struct stat status {};
        ::flock(file_, LOCK_EX);
        return ::fstat(file_, &status) == 0 && status.st_nlink > 0;
    }
    void remove() {
        if (exists_) ::unlink(path_.c_str());
    }

    std::string path_;
    Descriptor file_;
    bool exists_ = false;
    AtEarlyEnd at_early_end_{[this] { remove(); }};
};

/// Whether a text is that of two numbers with a dash between them.
bool is_process_and_number(std::string_view text) {
    const auto is_number = [](std::string_view part) {
        return !part.empty() && part.find_first_not_of("0123456789") == std::string_view::npos;
    };
    const std::size_t dash = text.find('-');
    return dash != std::string_view::npos && is_number(text.substr(0, dash)) && is_number(text.substr(dash + 1));
}

/// Removes what processes that were killed have left of a target.
void remove_left_behind(const std::string& target) {
    const std::string start = std::filesystem::path(target).filename().string() + unfinished_mark;
    std::error_code failure;
    for (const auto& entry : std::filesystem::directory_iterator(folder_of(target), failure)) {
        const std::string name = entry.path().filename().string();
        if (!name.starts_with(start) || !is_process_and_number(std::string_view(name).substr(start.size()))) continue;
        const Descriptor file(entry.path().string(), O_WRONLY | O_NONBLOCK | O_NOFOLLOW);
        if (file && ::flock(file, LOCK_EX | LOCK_NB) == 0) ::unlink(entry.path().c_str());
    }
}

} // namespace

OutputTarget output_target(const std::string& path) {
    constexpr int most_links = 40;
    std::filesystem::path target = path;
    std::error_code failure;
    for (int k = 0; k < most_links; ++k) {
        const std::filesystem::path folder = std::filesystem::weakly_canonical(folder_of(target.string()), failure);
        const std::string own = "/proc/" + std::to_string(::getpid()) + "/fd", name = target.filename().string();
        int number = 0;
        const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
        if (!failure && folder == own && error == std::errc{} && end == name.data() + name.size())
            return {target.string(), number};
        if (!std::filesystem::is_symlink(target, failure)) break;
        const std::filesystem::path next = std::filesystem::read_symlink(target, failure);
        if (failure) break;
        target = next.is_absolute() ? next : target.parent_path() / next;
    }
    return {target.string(), {}};
}

void OutputFile::write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(descriptor_, bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0)
            throw FileError(path_, "cannot be written: " + reason() + "; free some space or choose another folder");
        bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
}

void write_atomically(const std::string& path, const std::function<void(OutputFile&)>& write) {
    const auto [target, descriptor] = output_target(path);
    struct stat status {};
    if (descriptor || ::stat(target.c_str(), &status) == 0) {
        if (S_ISDIR(status.st_mode)) throw FileError(path, "is a directory; name a file in it");
        // A device, a pipe or what this process has open is written to, never replaced.
        if (descriptor || !S_ISREG(status.st_mode)) {
            Descriptor device = descriptor ? Descriptor::copy_of(*descriptor) : Descriptor(target, O_WRONLY);
            if (!device) throw FileError(path, "cannot be opened: " + reason());
            OutputFile output(path, device);
            write(output);
            if (!device.close()) throw FileError(path, "cannot be written: " + reason());
            return;
        }
    }

    const bool replaces = status.st_nlink > 0;
    remove_left_behind(target);
    UnfinishedFile unfinished(target);
    if (replaces) ::fchmod(unfinished.descriptor(), status.st_mode & 07777); // who may read it stays so
    OutputFile output(path, unfinished.descriptor());
    write(output);
    unfinished.rename_to(target, path);

    // The rename itself lasts once its folder is on disk; a file system that cannot say so is no
    // fault.
    const Descriptor directory(folder_of(target).string(), O_RDONLY | O_DIRECTORY);
    if (directory) ::fsync(directory);
}

void write_file(const std::string& path, std::string_view content) {
    write_atomically(path, [&](OutputFile& file) { file.write(std::as_bytes(std::span(content))); });
}

void make_folder(const std::string& path) {
    std::error_code failure;
    std::filesystem::create_directories(path, failure);
    if (failure) throw FileError(path, "cannot be made: " + failure.message());
}

MappedFile::MappedFile(const std::string& path) {
    const Descriptor file(path,
                          O_RDONLY | O_NONBLOCK); // opening a pipe must not wait for its writer
    struct stat status {};
    // No fault of the file, which might else be left out and passed over.
    if (!file && (errno == EMFILE || errno == ENFILE)) throw Error("too many files are open to read " + path + "; close some, or lift the limit (ulimit -n)");
    if (!file || ::fstat(file, &status) != 0) throw FileError(path, "cannot be read: " + reason());
    if (!S_ISREG(status.st_mode)) throw FileError(path, "is not a regular file");
    size_ = static_cast<std::size_t>(status.st_size);
    if (size_ == 0) return; // nothing to map
    void* data = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
    if (data == MAP_FAILED && errno == ENOMEM) throw std::bad_alloc();
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
