#include "transport/csv_points.h"

#include "core/error.h"
#include "core/file.h"
#include "core/text.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string_view>
#include <utility>

namespace afterglow {
namespace {

/// A first line of so many names, not numbers.
bool is_header(std::string_view line, std::size_t columns) {
    for (std::size_t c = 1;; ++c) {
        const auto comma = line.find(',');
        const std::string_view name = trimmed(line.substr(0, comma));
        constexpr std::string_view of_numbers = "+-.0123456789";
        if (name.empty() || of_numbers.find(name[0]) != std::string_view::npos) return false;
        float value = 0.0f;
        if (std::from_chars(name.data(), name.data() + name.size(), value).ptr == name.data() + name.size())
            return false; // nan, inf
        if (comma == std::string_view::npos) return c == columns;
        line.remove_prefix(comma + 1);
    }
}

/// Calls use(line_number, row) for each line of `columns` numbers. Blank lines are skipped.
template <std::size_t columns, class Use>
void read_rows(const std::string& path, const char* names, const Use& use) {
    std::ifstream file(path);
    if (!file) throw FileError(path, "cannot be opened");
    std::string text;
    bool first = true;
    for (std::size_t number = 1; std::getline(file, text); ++number) {
        std::string_view rest = trimmed(text);
        if (rest.starts_with(byte_order_mark)) rest.remove_prefix(byte_order_mark.size());
        if (rest.empty()) continue;
        if (std::exchange(first, false) && is_header(rest, columns)) continue;
        const std::string where = "line " + std::to_string(number) + ": ";
        std::array<float, columns> row{};
        for (std::size_t c = 0; c < columns; ++c) {
            const auto comma = rest.find(',');
            if ((comma == std::string_view::npos) != (c + 1 == columns))
                throw FileError(path, where + "must hold " + std::to_string(columns) + " numbers "
                                          + names);
            if (!parse_finite(trimmed(rest.substr(0, comma)), row[c]))
                throw FileError(path, where + "'" + printable(std::string(trimmed(rest.substr(0, comma))))
                                          + "' is not a finite number");
            if (comma != std::string_view::npos) rest.remove_prefix(comma + 1);
        }
        use(where, row);
    }
    if (file.bad()) throw FileError(path, "cannot be read to its end");
}

void append_number(std::string& text, float value) {
    std::array<char, 32> digits;
    text.append(digits.data(),
                std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr);
}

template <class Use>
void read_points(const std::string& path, const Use& use) {
    bool any = false;
    read_rows<6>(path, "x,y,z,nx,ny,nz", [&](const std::string& where, const auto& row) {
        const Vec3 normal(row[3], row[4], row[5]);
        const Vec3 unit = normal.stableNormalized();
        if (!(std::abs(unit.norm() - 1.0f) < 1e-3f))
            throw FileError(path, where + "the normal must not be zero");
        const Vec3 position(row[0], row[1], row[2]);
        if (!is_reachable(position)) throw FileError(path, where + "the position must be within 1e12 of the origin");
        any = true;
        use(SurfacePoint{position, unit});
    });
    if (!any) throw FileError(path, "holds no points");
}

constexpr const char* irradiance_header = "E_r,E_g,E_b\n";

void append_rows(std::string& text, const Eigen::Array3Xf& irradiance) {
    for (Index k = 0; k < irradiance.cols(); ++k)
        for (int c = 0; c < 3; ++c) {
            append_number(text, irradiance(c, k));
            text += c < 2 ? ',' : '\n';
        }
}

} // namespace

std::vector<SurfacePoint> read_points_csv(const std::string& path) {
    std::vector<SurfacePoint> points;
    read_points(path, [&](const SurfacePoint& point) { points.push_back(point); });
    return points;
}

void tell_of_moved_places(const PlacesMoved& moved, std::size_t count) {
    if (moved.moved > 0)
        std::fprintf(stderr, "%lld of %zu points lay off the surfaces, by %.2g at most, and were moved onto them\n",
                     static_cast<long long>(moved.moved), count, static_cast<double>(moved.farthest));
    if (moved.lost > 0)
        std::fprintf(stderr, "afterglow: warning: %lld of %zu points are on no surface\n", static_cast<long long>(moved.lost), count);
}

void write_irradiance_csv(const std::string& path, const Eigen::Array3Xf& irradiance) {
    std::string text = irradiance_header;
    append_rows(text, irradiance);
    write_file(path, text);
}

void answer_points_csv(const std::string& points, const std::string& output,
                       const std::function<Eigen::Array3Xf(std::span<SurfacePoint>)>& answer,
                       std::size_t block) {
    write_atomically(output, [&](OutputFile& file) {
        std::vector<SurfacePoint> waiting;
        std::string text = irradiance_header;
        const auto answer_waiting = [&] {
            append_rows(text, answer(waiting));
            file.write(std::as_bytes(std::span(text)));
            waiting.clear();
            text.clear();
        };
        read_points(points, [&](const SurfacePoint& point) {
            waiting.push_back(point);
            if (waiting.size() == block) answer_waiting();
        });
        if (!waiting.empty()) answer_waiting();
    });
}

Eigen::Array3Xf read_irradiance_csv(const std::string& path) {
    std::vector<float> values;
    read_rows<3>(path, "E_r,E_g,E_b", [&](const std::string&, const auto& row) {
        values.insert(values.end(), row.begin(), row.end());
    });
    if (values.empty()) throw FileError(path, "holds no values");
    return Eigen::Array3Xf::Map(values.data(), 3, static_cast<Index>(values.size() / 3));
}

} // namespace afterglow
