#include "transport/safetensors.h"

#include "core/error.h"

#include <nlohmann/json.hpp>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

namespace afterglow {
namespace {

using OrderedJson = nlohmann::ordered_json; // keeps the order in which tensors lie in the file

constexpr std::uint64_t alignment = 64; // a cache line, and the widest vector register
constexpr std::uint64_t max_header_bytes =
    1 << 20;                            // bounds what a hostile header can make us allocate
constexpr std::size_t max_names = 4096; // in one JSON object: a look-up is linear
constexpr std::size_t max_rank = 8;
constexpr int max_depth = 3; // the header, a tensor's entry, its shape or offsets
constexpr std::size_t hash_digits = 32;

constexpr std::string_view metadata_key = "__metadata__";
constexpr std::string_view padding_prefix = "padding.";
constexpr std::string_view checksum_key = "checksum";
constexpr std::string_view header_checksum_key = "header_checksum";
// How the checksum of the header stands in the header. Quotes inside a JSON string are escaped, so
// that nothing but the key itself can look like this.
constexpr std::string_view header_checksum_field = "\"header_checksum\":\"";

struct DTypeInfo {
    DType dtype;
    std::string_view name;
    std::uint64_t size;
};
constexpr std::array<DTypeInfo, 7> dtypes = {{{DType::f32, "F32", 4},
                                              {DType::f16, "F16", 2},
                                              {DType::u64, "U64", 8},
                                              {DType::u32, "U32", 4},
                                              {DType::u16, "U16", 2},
                                              {DType::u8, "U8", 1},
                                              {DType::i8, "I8", 1}}};

const DTypeInfo& info(DType dtype) {
    return *std::find_if(dtypes.begin(), dtypes.end(),
                         [&](const DTypeInfo& d) { return d.dtype == dtype; });
}

std::string describe(DType dtype, const TensorShape& shape) {
    std::string text = std::string(info(dtype).name) + " [";
    for (std::size_t i = 0; i < shape.size(); ++i) {
        if (i > 0) text += ", ";
        text += shape[i] == any_extent ? "any" : std::to_string(shape[i]);
    }
    return text + "]";
}

/// Bytes of a dense tensor; none where the number does not fit into 64 bits.
std::optional<std::uint64_t> byte_count(DType dtype, const TensorShape& shape) {
    std::uint64_t bytes = info(dtype).size;
    for (const std::uint64_t extent : shape)
        if (__builtin_mul_overflow(bytes, extent, &bytes)) return std::nullopt;
    return bytes;
}

std::uint64_t round_up(std::uint64_t bytes) {
    return (bytes + alignment - 1) / alignment * alignment;
}

bool is_padding(const std::string& name) {
    return name.starts_with(padding_prefix);
}

// Writing

/// The tensors in order, with a tensor of zeros wherever the next would start unaligned: the format
/// knows no gaps.
std::vector<Tensor> with_padding(std::span<const Tensor> tensors) {
    static constexpr std::array<std::byte, alignment> zeros = {};
    std::vector<Tensor> padded;
    std::uint64_t end = 0;
    for (const Tensor& tensor : tensors) {
        if (const std::uint64_t gap = round_up(end) - end; gap > 0) {
            padded.push_back({std::string(padding_prefix) + std::to_string(padded.size()),
                              DType::u8,
                              {gap},
                              std::span(zeros).first(gap)});
            end += gap;
        }
        padded.push_back(tensor);
        end += tensor.bytes.size();
    }
    return padded;
}

/// hash_hex() of the bytes of all tensors, one after the other.
std::string checksum_of(const std::vector<Tensor>& tensors) {
    const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(),
                                                                         &XXH3_freeState);
    if (!state) throw std::bad_alloc();
    XXH3_128bits_reset(state.get());
    for (const Tensor& tensor : tensors)
        XXH3_128bits_update(state.get(), tensor.bytes.data(), tensor.bytes.size());
    XXH128_canonical_t digest;
    XXH128_canonicalFromHash(&digest, XXH3_128bits_digest(state.get()));
    std::string text;
    for (const unsigned char byte : digest.digest) {
        text += "0123456789abcdef"[byte >> 4];
        text += "0123456789abcdef"[byte & 15];
    }
    return text;
}

/// The checksum of the length and the header, taken with its own digits as zeros at `digits`.
std::string header_checksum(std::string header, std::size_t digits) {
    std::fill_n(header.begin() + static_cast<std::ptrdiff_t>(digits), hash_digits, '0');
    return hash_hex(std::as_bytes(std::span(header)));
}

/// Everything before the first tensor: length, JSON and the spaces that align what follows.
std::string make_header(const std::string& path, const std::vector<Tensor>& tensors,
                        TensorMetadata metadata) {
    metadata.emplace(checksum_key, checksum_of(tensors));
    metadata.emplace(header_checksum_key, std::string(hash_digits, '0'));
    OrderedJson json;
    json[std::string(metadata_key)] = metadata;
    std::uint64_t end = 0;
    for (const Tensor& tensor : tensors) {
        const std::uint64_t begin = std::exchange(end, end + tensor.bytes.size());
        json[tensor.name] = {{"dtype", info(tensor.dtype).name},
                             {"shape", tensor.shape},
                             {"data_offsets", {begin, end}}};
    }
    std::string header(sizeof(std::uint64_t), '\0');
    try {
        header += json.dump();
    } catch (const OrderedJson::exception&) {
        throw FileError(path, "cannot be written: a name or a metadata string is not valid UTF-8");
    }
    header.resize(round_up(header.size()), ' ');
    const std::uint64_t length = header.size() - sizeof(std::uint64_t);
    if (length > max_header_bytes)
        throw FileError(path, "cannot be written: its header would have " + std::to_string(length)
                                  + " bytes, at most " + std::to_string(max_header_bytes)
                                  + " are read back");
    std::memcpy(header.data(), &length, sizeof(length));

    const std::size_t digits = header.find(header_checksum_field) + header_checksum_field.size();
    header.replace(digits, hash_digits, header_checksum(header, digits));
    return header;
}

[[maybe_unused]] bool writable(std::span<const Tensor> tensors, const TensorMetadata& metadata) {
    std::set<std::string_view> names;
    for (const Tensor& tensor : tensors) {
        const auto bytes = byte_count(tensor.dtype, tensor.shape);
        if (tensor.shape.size() > max_rank || bytes != tensor.bytes.size()) return false;
        if (tensor.name.starts_with("__") || is_padding(tensor.name)) return false;
        if (!names.insert(tensor.name).second) return false;
    }
    return !metadata.contains(std::string(checksum_key))
           && !metadata.contains(std::string(header_checksum_key));
}

// Reading

/// Takes a mapped file apart, trusting nothing.
class HeaderReader {
public:
    HeaderReader(const std::string& path, std::span<const std::byte> file) : path_(path), file_(file) {}

    void read(std::vector<Tensor>& tensors, TensorMetadata& metadata) {
        split();
        check_header_checksum();
        const OrderedJson json = parse();
        metadata = read_metadata(json);
        read_tensors(json, tensors);
        const std::string checksum = take(metadata, checksum_key);
        take(metadata, header_checksum_key);
        if (hash_hex(data_) != checksum)
            fail("is damaged: the checksum of its tensors does not match");
    }

private:
    [[noreturn]] void fail(const std::string& what) const {
        throw FileError(path_, what + "; copy it again or run precompute again");
    }

    void split() {
        std::uint64_t length = 0;
        if (file_.size() < sizeof(length)) fail("is no safetensors file: too short");
        std::memcpy(&length, file_.data(), sizeof(length));
        if (length > max_header_bytes || length > file_.size() - sizeof(length))
            fail("is truncated or no safetensors file: a header of " + std::to_string(length)
                 + " bytes in a file of " + std::to_string(file_.size()));
        const std::size_t data_begin = sizeof(length) + length;
        if (data_begin % alignment != 0) fail("has a header that does not end on 64 bytes");
        const auto head = file_.first(data_begin);
        header_.assign(reinterpret_cast<const char*>(head.data()), head.size());
        data_ = file_.subspan(data_begin);
    }

    void check_header_checksum() const {
        const std::size_t field = header_.find(header_checksum_field);
        const std::size_t digits = field + header_checksum_field.size();
        if (field == std::string::npos || header_.size() - digits < hash_digits)
            fail("has no header checksum: damaged, or not written by afterglow");
        if (header_.compare(digits, hash_digits, header_checksum(header_, digits)) != 0)
            fail("is damaged: the checksum of its header does not match");
    }

    OrderedJson parse() const {
        // The parser would keep the last of two equal keys, and build arbitrarily deep trees.
        std::array<std::set<std::string>, max_depth + 1> keys;
        const auto watch = [&](int depth, OrderedJson::parse_event_t event, OrderedJson& parsed) {
            const auto level = static_cast<std::size_t>(depth);
            if (event == OrderedJson::parse_event_t::object_start
                || event == OrderedJson::parse_event_t::array_start) {
                if (depth >= max_depth) fail("has a header that nests too deeply");
                keys[level + 1].clear();
            } else if (event == OrderedJson::parse_event_t::key) {
                if (!keys[level].insert(parsed.get<std::string>()).second)
                    fail("has a header that names '" + printable(parsed.get<std::string>())
                         + "' twice");
                if (keys[level].size() > max_names) fail("has a header with too many names");
            }
            return true;
        };
        try {
            OrderedJson json = OrderedJson::parse(header_.begin() + sizeof(std::uint64_t), header_.end(), watch);
            if (!json.is_object()) fail("has a header that is no JSON object");
            return json;
        } catch (const OrderedJson::exception&) {
            fail("has a header that is not valid JSON");
        }
    }

    TensorMetadata read_metadata(const OrderedJson& json) const {
        const auto entry = json.find(metadata_key);
        if (entry == json.end() || !entry->is_object()) fail("has no metadata");
        TensorMetadata metadata;
        for (const auto& [key, value] : entry->items()) {
            if (!value.is_string()) fail("has metadata '" + printable(key) + "' that is no string");
            metadata.emplace(key, value.get<std::string>());
        }
        return metadata;
    }

    std::string take(TensorMetadata& metadata, std::string_view key) const {
        const auto node = metadata.extract(std::string(key));
        if (node.empty()) fail("has no metadata '" + std::string(key) + "'");
        return node.mapped();
    }

    void read_tensors(const OrderedJson& json, std::vector<Tensor>& tensors) const {
        std::uint64_t end = 0;
        for (const auto& [name, entry] : json.items()) {
            if (name == metadata_key) continue;
            Tensor tensor = read_tensor(name, entry, end);
            end += tensor.bytes.size();
            if (!is_padding(name)) tensors.push_back(std::move(tensor));
        }
        if (end != data_.size())
            fail("is truncated or too long: its tensors have " + std::to_string(end) + " bytes, "
                 + std::to_string(data_.size()) + " follow the header");
    }

    /// One entry of the header, whose bytes must start at `begin`, where the previous tensor ended.
    Tensor read_tensor(const std::string& name, const OrderedJson& entry, std::uint64_t begin) const {
        const std::string tensor_name = "tensor '" + printable(name) + "' ";
        if (!entry.is_object() || entry.size() != 3 || !entry.contains("dtype")
            || !entry.contains("shape") || !entry.contains("data_offsets"))
            fail(tensor_name + "needs dtype, shape and data_offsets, and nothing else");
        Tensor tensor;
        tensor.name = name;
        const OrderedJson& dtype = entry["dtype"];
        const auto known = std::find_if(dtypes.begin(), dtypes.end(), [&](const DTypeInfo& d) {
            return dtype.is_string() && dtype.get_ref<const std::string&>() == d.name;
        });
        if (known == dtypes.end()) fail(tensor_name + "has an unknown dtype");
        tensor.dtype = known->dtype;
        tensor.shape = unsigned_list(entry["shape"], tensor_name + "has a bad shape");
        if (tensor.shape.size() > max_rank) fail(tensor_name + "has too many dimensions");

        const auto offsets = unsigned_list(entry["data_offsets"], tensor_name + "has bad offsets");
        if (offsets.size() != 2 || offsets[0] != begin || offsets[1] < begin
            || offsets[1] > data_.size())
            fail(tensor_name + "does not lie behind the one before it and inside the file");
        tensor.bytes = data_.subspan(begin, offsets[1] - begin);
        if (byte_count(tensor.dtype, tensor.shape) != tensor.bytes.size())
            fail(tensor_name + "has " + std::to_string(tensor.bytes.size())
                 + " bytes, which is not what its shape needs: "
                 + describe(tensor.dtype, tensor.shape));
        if (begin % alignment != 0 && !is_padding(name))
            fail(tensor_name + "does not start at a multiple of 64 bytes");
        return tensor;
    }

    std::vector<std::uint64_t> unsigned_list(const OrderedJson& list, const std::string& complaint) const {
        const auto is_unsigned = [](const OrderedJson& value) { return value.is_number_unsigned(); };
        if (!list.is_array() || !std::all_of(list.begin(), list.end(), is_unsigned))
            fail(complaint);
        return list.get<std::vector<std::uint64_t>>();
    }

    const std::string& path_;
    std::span<const std::byte> file_;
    std::span<const std::byte> data_; // what follows the header
    std::string header_;              // with its length
};

bool fits(const TensorShape& shape, const TensorShape& expected) {
    return std::equal(shape.begin(), shape.end(), expected.begin(), expected.end(),
                      [](std::uint64_t a, std::uint64_t b) { return b == any_extent || a == b; });
}

} // namespace

std::uint64_t write_safetensors(const std::string& path, std::span<const Tensor> tensors,
                                const TensorMetadata& metadata) {
    assert(writable(tensors, metadata));
    const std::vector<Tensor> padded = with_padding(tensors);
    const std::string header = make_header(path, padded, metadata);
    std::uint64_t bytes = header.size();
    write_atomically(path, [&](OutputFile& file) {
        file.write(std::as_bytes(std::span(header)));
        for (const Tensor& tensor : padded) {
            file.write(tensor.bytes);
            bytes += tensor.bytes.size();
        }
    });
    return bytes;
}

SafetensorsFile::SafetensorsFile(const std::string& path)
    : path_(path), map_(std::make_shared<const MappedFile>(path)) {
    HeaderReader(path_, map_->bytes()).read(tensors_, metadata_);
}

const std::string& SafetensorsFile::metadata(const std::string& key) const {
    const auto entry = metadata_.find(key);
    if (entry == metadata_.end())
        throw FileError(path_, "has no metadata '" + key + "'; run precompute again");
    return entry->second;
}

const Tensor& SafetensorsFile::find(const std::string& name, DType dtype,
                                    const TensorShape& expected) const {
    const auto tensor = std::find_if(tensors_.begin(), tensors_.end(),
                                     [&](const Tensor& t) { return t.name == name; });
    const std::string wanted = "tensor '" + name + "' " + describe(dtype, expected);
    if (tensor == tensors_.end())
        throw FileError(path_, "has no " + wanted + "; run precompute again");
    if (tensor->dtype != dtype || !fits(tensor->shape, expected))
        throw FileError(path_, "should hold " + wanted + ", but holds "
                                   + describe(tensor->dtype, tensor->shape)
                                   + "; run precompute again");
    return *tensor;
}

} // namespace afterglow
