#include "core/error.h"
#include "tests/support/file_error.h"
#include "tests/support/small_transfer.h"
#include "tests/support/temporary_folder.h"
#include "transport/safetensors.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <map>

namespace afterglow {
namespace {

/// "accepted", or what the one line of the FileError says.
std::string load(const std::string& path) {
    return refusal_of([&] { load_transfer(path); });
}

std::string bytes_of(const SmallTransfer& small) {
    const TemporaryFolder folder;
    save_transfer(folder.path("t"), small.transfer, small.provenance);
    return content_of(folder.path("t"));
}

const std::string& small_file() {
    static const std::string bytes = bytes_of(small_transfer());
    return bytes;
}

const std::string& small_paper_file() {
    static const std::string bytes = bytes_of(small_paper_transfer());
    return bytes;
}

TEST(HostileTransferFile, ATruncatedFileIsAnError) {
    const TemporaryFolder folder;
    for (const std::string* whole : {&small_file(), &small_paper_file()}) {
        const std::string path = folder.write("t", *whole);
        ASSERT_EQ(load(path), "accepted");
        for (std::size_t length = whole->size() - 1; length > 0;
             length -= length > 400 ? std::min<std::size_t>(length - 400, 997) : 1) {
            std::filesystem::resize_file(path, length);
            ASSERT_NE(load(path), "accepted") << length << " bytes";
        }
    }
}

TEST(HostileTransferFile, AFlippedBitIsAnError) {
    const TemporaryFolder folder;
    const std::string path = folder.write("t", small_file());
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    const auto put = [&](std::size_t place, char byte) {
        file.seekp(static_cast<std::streamoff>(place));
        file.put(byte).flush();
    };
    const std::size_t step = small_file().size() / 1500;
    for (std::size_t place = 0; place < small_file().size(); place += place < 2000 ? 3 : step) {
        const char byte = small_file()[place];
        put(place, static_cast<char>(byte ^ (1 << place % 8)));
        ASSERT_NE(load(path), "accepted") << "byte " << place;
        put(place, byte);
    }
    EXPECT_EQ(load(path), "accepted");
}

/// The small file taken apart, to be put together again with one thing wrong and right checksums.
struct Parts {
    std::map<std::string, std::vector<std::byte>> bytes;
    std::vector<Tensor> tensors;
    TensorMetadata metadata;

    explicit Parts(const SafetensorsFile& file)
        : tensors(file.tensors()), metadata(file.metadata()) {
        for (const Tensor& t : tensors)
            bytes[t.name] = {t.bytes.begin(), t.bytes.end()};
    }
    Tensor& tensor(const std::string& name) {
        return *std::find_if(tensors.begin(), tensors.end(),
                             [&](const Tensor& t) { return t.name == name; });
    }
    template <class T>
    std::span<T> values(const std::string& name) {
        return {reinterpret_cast<T*>(bytes.at(name).data()), bytes.at(name).size() / sizeof(T)};
    }
    /// Keeps the first `count` of the tensor's slowest extent.
    void shorten(const std::string& name, std::uint64_t count) {
        Tensor& t = tensor(name);
        bytes[name].resize(bytes[name].size() / t.shape[0] * count);
        t.shape[0] = count;
    }
    /// Replaces a piece of the model's JSON.
    void change_model(const std::string& from, const std::string& to) {
        std::string& model = metadata["model"];
        ASSERT_NE(model.find(from), std::string::npos) << model;
        model.replace(model.find(from), from.size(), to);
    }
    void write(const std::string& path) {
        for (Tensor& t : tensors)
            t.bytes = bytes.at(t.name);
        write_safetensors(path, tensors, metadata);
    }
};

using Damage = std::function<void(Parts&)>;

void expect_refusal(const std::map<std::string, Damage>& damages,
                    const std::string& whole = small_file()) {
    const TemporaryFolder folder;
    const SafetensorsFile good(folder.write("good", whole));
    Parts untouched(good);
    untouched.write(folder.path("t"));
    ASSERT_EQ(load(folder.path("t")), "accepted");
    for (const auto& [what, damage] : damages) {
        Parts parts(good);
        damage(parts);
        parts.write(folder.path("t"));
        EXPECT_NE(load(folder.path("t")), "accepted") << what;
    }
}

template <class T>
Damage set(const std::string& name, std::size_t place, T value) {
    return [=](Parts& parts) { parts.values<T>(name)[place] = value; };
}

/// The first row of at least two entries at or after `row`.
std::uint64_t long_row(Parts& parts, const std::string& begin, std::uint64_t row = 0) {
    const auto offsets = parts.values<std::uint64_t>(begin);
    while (offsets[row + 1] < offsets[row] + 2)
        ++row;
    return offsets[row];
}

TEST(HostileTransferFile, NumbersThatCannotBeAreRefusedThoughTheChecksumsAreRight) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const float infinite = std::numeric_limits<float>::infinity();
    expect_refusal({
        {"position NaN", set("points.position", 4, nan)},
        {"position infinite", set("points.position", 0, infinite)},
        {"position beyond Embree's reach", set("points.position", 0, 1e30f)},
        {"support beyond it", set("points.support", 3, 1e30f)},
        {"normal NaN", set("points.normal", 0, nan)},
        {"normal too long", set("points.normal", 1, 2.0f)},
        {"support zero", set("points.support", 3, 0.0f)},
        {"support negative", set("points.support", 3, -1.0f)},
        {"support NaN", set("points.support", 3, nan)},
        {"reflectance one", set("points.reflectance", 5, 1.0f)},
        {"reflectance negative", set("points.reflectance", 5, -0.1f)},
        {"reflectance NaN", set("points.reflectance", 5, nan)},
        {"spacing zero", set("spacing", 1, 0.0f)},
        {"spacing infinite", set("spacing", 1, infinite)},
        {"pull NaN", set("pull.value", 0, nan)},
        {"pull negative", set("pull.value", 0, -0.5f)},
        {"push NaN", set("push.value", 0, nan)},
        {"push negative", set("push.value", 0, -0.5f)},
        {"push huge", set("push.value", 0, 1e30f)},
        {"sender area NaN", set("senders.area", 0, nan)},
        {"sender area negative", set("senders.area", 1, -1e-3f)},
        {"sender area infinite", set("senders.area", 0, infinite)},
    });
}

/// Replaces the bits of the first entry of the links.
Damage first_link(std::uint32_t bits) {
    return set("links.packed", 0,
               PackedLink{static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8),
                          static_cast<std::uint8_t>(bits >> 16)});
}

TEST(HostileTransferFile, RowsThatAreNotRowsAreRefused) {
    const auto far = std::uint64_t(1) << 60;
    const std::uint32_t senders = small_transfer().transfer.senders();
    const std::uint32_t points = small_transfer().transfer.points.size();
    expect_refusal({
        {"links begin late", set("links.begin", 0, std::uint64_t(1))},
        {"links end elsewhere", set("links.begin", points, std::uint64_t(3))},
        {"links offset far", set("links.begin", 5, far)},
        {"links offset falls", set("links.begin", 5, std::uint64_t(0))},
        {"links step of nothing", first_link(0x111000)},
        {"links jump of nothing", first_link(0)},
        {"links sender out of range",
         [=](Parts& p) {
             // The last link's step, by as many senders as there are and no fewer.
             auto bytes = p.values<PackedLink>("links.packed");
             const std::uint32_t jump = std::min(senders, 4095u);
             bytes.back() = {static_cast<std::uint8_t>(jump), static_cast<std::uint8_t>(jump >> 8), 0};
         }},
        {"push offset falls", set("push.begin", points - 1, std::uint64_t(0))},
        {"push of the coarsest", [](Parts& p) { p.values<std::uint64_t>("push.begin")[1] = 1; }},
        {"push row unsorted",
         [](Parts& p) {
             const auto at = long_row(p, "push.begin");
             const auto index = p.values<std::uint32_t>("push.index");
             std::swap(index[at], index[at + 1]);
         }},
        {"push out of range", [](Parts& p) { p.values<std::uint32_t>("push.index").back() = ~0u; }},
        {"push from its own level",
         [=](Parts& p) { p.values<std::uint32_t>("push.index").back() = points - 1; }},
        {"pull offset falls", set("pull.begin", 1, std::uint64_t(1) << 40)},
        {"pull from its own level",
         [](Parts& p) { p.values<std::uint32_t>("pull.index")[0] = 0; }},
        {"push past a level", [](Parts& p) { p.values<std::uint32_t>("push.index").back() = 0; }},
    });
}

TEST(HostileTransferFile, APapersOperatorIsCheckedLikeOurs) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const TransferOperator& transfer = small_paper_transfer().transfer;
    const std::uint32_t senders = transfer.senders(), points = transfer.points.size();
    std::map<std::string, Damage> damages = {
        {"link NaN", set("solution.value", 3, nan)},
        {"links begin late", set("solution.begin", 0, std::uint64_t(1))},
        {"links offset far", set("solution.begin", 5, std::uint64_t(1) << 60)},
        {"links end elsewhere", set("solution.begin", points, std::uint64_t(3))},
        {"sender out of range",
         [=](Parts& p) { p.values<std::uint32_t>("solution.index").back() = senders; }},
        {"links unsorted",
         [](Parts& p) {
             const auto at = long_row(p, "solution.begin");
             const auto index = p.values<std::uint32_t>("solution.index");
             std::swap(index[at], index[at + 1]);
         }},
        {"share NaN", set("pyramid.value", 0, nan)},
        {"share negative", set("pyramid.value", 0, -0.5f)},
        {"pyramid offset falls", set("pyramid.begin", senders - 1, std::uint64_t(0))},
        {"pyramid of the coarsest",
         [](Parts& p) { p.values<std::uint64_t>("pyramid.begin")[1] = 1; }},
        {"pyramid from its own level",
         [=](Parts& p) { p.values<std::uint32_t>("pyramid.index").back() = senders - 1; }},
        {"no bounce", [](Parts& p) { p.change_model("\"bounces\":4", "\"bounces\":0"); }},
        {"display predicted by another level",
         [](Parts& p) { p.change_model("\"display_parent\":1", "\"display_parent\":0"); }},
        {"ours by its name", [](Parts& p) { p.change_model("paper", "neumann"); }},
    };
    for (const char* name : {"pyramid.begin", "pyramid.index", "pyramid.value", "solution.begin",
                             "solution.index", "solution.value"}) {
        damages[std::string(name) + " is short"] = [=](Parts& p) {
            p.shorten(name, p.tensor(name).shape[0] - 1);
        };
        damages[std::string(name) + " is missing"] = [=](Parts& p) {
            p.tensors.erase(p.tensors.begin() + (&p.tensor(name) - p.tensors.data()));
        };
    }
    expect_refusal(damages, small_paper_file());
}

TEST(HostileTransferFile, SizesThatDoNotAgreeAreRefused) {
    const auto levels = [](std::vector<std::uint32_t> begin) {
        return [=](Parts& p) {
            const auto values = p.values<std::uint32_t>("level_begin");
            std::copy(begin.begin(), begin.end(), values.begin());
        };
    };
    const auto& good = small_transfer().transfer.points.level_begin;
    std::map<std::string, Damage> damages = {
        {"levels from one", levels({1, good[1], good[2], good[3]})},
        {"levels fall", levels({0, good[2], good[1], good[3]})},
        {"levels beyond the points", levels({0, good[1], good[2], good[3] + 1})},
        {"levels to the end of numbers", levels({0, good[1], good[2], ~0u})},
        {"no points", levels({0, 0, 0, 0})},
        {"level shifted", levels({0, good[1] + 1, good[2], good[3]})},
        {"no levels",
         [](Parts& p) {
             p.shorten("level_begin", 1);
             p.shorten("spacing", 0);
         }},
        {"nothing in level_begin", [](Parts& p) { p.shorten("level_begin", 0); }},
        {"link of two bytes",
         [](Parts& p) {
             p.bytes["links.packed"].resize(p.bytes["links.packed"].size() / 6 * 6);
             p.tensor("links.packed").shape = {p.bytes["links.packed"].size() / 2, 2};
         }},
        {"position flat",
         [](Parts& p) {
             p.tensor("points.position").shape = {p.bytes["points.position"].size() / 4};
         }},
        {"other type", [](Parts& p) { p.tensor("points.support").dtype = DType::u32; }},
    };
    for (const char* name :
         {"points.position", "points.normal", "points.support", "points.reflectance",
          "points.openness", "level_begin", "spacing", "push.begin", "push.index", "push.value",
          "pull.begin", "pull.index", "pull.value", "senders.area", "links.begin", "links.packed"}) {
        damages[std::string(name) + " is short"] = [=](Parts& p) {
            p.shorten(name, p.tensor(name).shape[0] - 1);
        };
        damages[std::string(name) + " is missing"] = [=](Parts& p) {
            p.tensors.erase(p.tensors.begin() + (&p.tensor(name) - p.tensors.data()));
        };
    }
    expect_refusal(damages);
}

TEST(HostileTransferFile, MetadataThatMakesNoSenseIsRefused) {
    const auto metadata = [](const std::string& key, const std::string& value) {
        return [=](Parts& p) { p.metadata[key] = value; };
    };
    const auto model = [](const std::string& from, const std::string& to) {
        return [=](Parts& p) { p.change_model(from, to); };
    };
    std::map<std::string, Damage> damages = {
        {"another format", metadata("format", "something else")},
        {"another version", metadata("format_version", "2")},
        {"seed of letters", metadata("seed", "one")},
        {"seed and more", metadata("seed", "1 ")},
        {"no path", metadata("scene", "")},
        {"path of two lines", metadata("scene", "a\nb.obj")},
        {"path without end", metadata("scene", std::string(10000, 'a'))},
        {"hash of two lines", metadata("scene_hash", "a\nb")},
        {"options broken", metadata("options", "{")},
        {"options a list", metadata("options", "[]")},
        {"statistics broken", metadata("statistics", "nonsense")},
        {"statistics nested", metadata("statistics", std::string(100000, '['))},
        {"model broken", metadata("model", "{\"sender_levels\":")},
        {"model empty", metadata("model", "{}")},
        {"another operator", model("neumann", "oracle")},
        {"operator a number", model("\"neumann\"", "3")},
        {"no sender level", model("\"sender_levels\":2", "\"sender_levels\":0")},
        {"too many sender levels", model("\"sender_levels\":2", "\"sender_levels\":4")},
        {"other sender levels", model("\"sender_levels\":2", "\"sender_levels\":3")},
        {"half a sender level", model("\"sender_levels\":2", "\"sender_levels\":1.5")},
        {"huge sender level",
         model("\"sender_levels\":2", "\"sender_levels\":18446744073709551615")},
        {"bounces negative", model("\"bounces\":0", "\"bounces\":-1")},
        {"bounces endless", model("\"bounces\":0", "\"bounces\":2000000000")},
        {"openness from another level", model("\"openness_level\":1", "\"openness_level\":2")},
        {"openness from beyond", model("\"openness_level\":1", "\"openness_level\":4")},
        {"weight power negative", model("\"weight_power\":", "\"weight_power\":-")},
        {"weight power beyond numbers", model("\"weight_power\":", "\"weight_power\":1e999")},
    };
    for (const char* key : {"format", "format_version", "version", "scene", "scene_hash", "seed",
                            "model", "options", "statistics"})
        damages[std::string("no ") + key] = [=](Parts& p) { p.metadata.erase(key); };
    expect_refusal(damages);
}

} // namespace
} // namespace afterglow
