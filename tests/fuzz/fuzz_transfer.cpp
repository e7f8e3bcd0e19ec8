#include "core/file.h"
#include "core/parallel.h"
#include "tests/fuzz/harness.h"
#include "transport/transfer_scene.h"

#include <cstring>
#include <span>

// A transfer file, whose checksums are put right first: they find accidents, and would keep everything
// behind them out of reach. What is accepted must bear being used.

using namespace afterglow;

namespace {

std::string hash_of(std::string_view text) {
    return hash_hex(std::as_bytes(std::span(text)));
}

/// Writes `digits` behind `field`; false where there is no place for them.
bool put(std::string& header, std::string_view field, const std::string& digits) {
    const std::size_t place = header.find(field);
    if (place == std::string::npos || header.size() - place < field.size() + digits.size())
        return false;
    header.replace(place + field.size(), digits.size(), digits);
    return true;
}

std::string with_checksums(std::string file) {
    std::uint64_t length = 0;
    if (file.size() < sizeof(length)) return file;
    std::memcpy(&length, file.data(), sizeof(length));
    if (length > file.size() - sizeof(length)) return file;
    std::string header = file.substr(0, sizeof(length) + length);
    const std::string tensors = file.substr(header.size());
    put(header, "\"checksum\":\"", hash_of(tensors));
    constexpr std::string_view own = "\"header_checksum\":\"";
    if (put(header, own, std::string(32, '0'))) put(header, own, hash_of(header));
    return header + tensors;
}

void use(const TransferOperator& transfer) {
    static const Scene scene = load_scene("builtin:cornell");
    static const Surface surface(scene);
    static const ThreadLimit alone(1);
    constexpr std::uint32_t most_points = 1000;
    if (transfer.points.size() > most_points) return; // as much work as the file is long
    Spotlight light;
    light.position = {0.5f, 0.9f, 0.5f};
    light.direction = -Vec3::UnitY();
    const LightTransport transport(transfer, surface);
    const VectorIrradiance field = transport.indirect(light);
    require(field.size() == 9u * transfer.points.size(), "nine numbers a point");
    const Display display(transfer, surface);
    bool covered = false;
    display.irradiance({{0.5f, 0.0f, 0.5f}, Vec3::UnitY()}, Vec3::UnitY(), field, light, covered, 4);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string file = input_folder().write("a.transfer", with_checksums(text_of(data, size)));
    accept_refusal([&] { use(load_transfer(file).transfer); });
    return 0;
}
