#pragma once

#include "core/file.h"

#include <Eigen/Core>

#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace afterglow {

/// Named arrays of numbers and a few strings in one file, readable by every safetensors library;
/// the layout and both checksums are told in docs/transfer-format.md. Knows nothing of what it
/// carries.

static_assert(std::endian::native == std::endian::little, "tensors are mapped as they lie on disk");

enum class DType { f32, f16, u64, u32, u16, u8, i8 };

template <class T>
struct DTypeOf;
// clang-format off
template <> struct DTypeOf<float>         { static constexpr DType value = DType::f32; };
template <> struct DTypeOf<Eigen::half>   { static constexpr DType value = DType::f16; };
template <> struct DTypeOf<std::uint64_t> { static constexpr DType value = DType::u64; };
template <> struct DTypeOf<std::uint32_t> { static constexpr DType value = DType::u32; };
template <> struct DTypeOf<std::uint16_t> { static constexpr DType value = DType::u16; };
template <> struct DTypeOf<std::uint8_t>  { static constexpr DType value = DType::u8; };
template <> struct DTypeOf<std::int8_t>   { static constexpr DType value = DType::i8; };
// clang-format on

/// Extents, slowest first (row-major); empty for a single number.
using TensorShape = std::vector<std::uint64_t>;

/// Stands for a yet unknown extent where a reader says what shape it expects.
inline constexpr std::uint64_t any_extent = std::numeric_limits<std::uint64_t>::max();

/// A tensor whose bytes somebody else owns: the caller of write_safetensors(), or a mapped file.
struct Tensor {
    std::string name;
    DType dtype = DType::f32;
    TensorShape shape;
    std::span<const std::byte> bytes;
};

/// values.size() must be the product of the extents.
template <class T>
Tensor make_tensor(std::string name, TensorShape shape, std::span<const T> values) {
    return {std::move(name), DTypeOf<T>::value, std::move(shape), std::as_bytes(values)};
}

using TensorMetadata = std::map<std::string, std::string>;

/// Writes the tensors in the order given, each at a multiple of 64 bytes, and the metadata; the
/// same arguments give the same bytes. The file appears whole or not at all. Names must differ and
/// must not start with "padding." or "__"; metadata keys must not be those of the checksums
/// (asserted). Returns the file's bytes. Throws FileError where the file cannot be written or a string is not UTF-8.
std::uint64_t write_safetensors(const std::string& path, std::span<const Tensor> tensors,
                       const TensorMetadata& metadata);

/// A file of write_safetensors(), mapped and checked: once constructed, every tensor lies inside
/// the file, aligned, with as many bytes as its shape says, and the bytes are those that were
/// written. What the numbers mean is for the caller to check. Cheap to copy.
class SafetensorsFile {
public:
    /// Reads the file once, at the speed of XXH3; allocates only for the header, of at most 1 MiB.
    /// Throws FileError where anything is wrong.
    explicit SafetensorsFile(const std::string& path);

    const std::string& path() const { return path_; }
    const std::vector<Tensor>& tensors() const { return tensors_; } // in the order of the file
    const TensorMetadata& metadata() const { return metadata_; }    // without the checksums

    /// Throws FileError where the key is missing.
    const std::string& metadata(const std::string& key) const;

    /// The values of a tensor of that type and shape, in place: valid while the map is held.
    /// Throws FileError where there is none.
    template <class T>
    std::span<const T> tensor(const std::string& name, const TensorShape& expected) const {
        const auto bytes = find(name, DTypeOf<T>::value, expected).bytes;
        return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
    }

    /// Keeps the spans valid after this object is gone.
    std::shared_ptr<const MappedFile> map() const { return map_; }

private:
    const Tensor& find(const std::string& name, DType dtype, const TensorShape& expected) const;

    std::string path_;
    std::shared_ptr<const MappedFile> map_;
    std::vector<Tensor> tensors_;
    TensorMetadata metadata_;
};

} // namespace afterglow
