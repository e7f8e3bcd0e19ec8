#include "transport/display_patches.h"

#include "core/parallel.h"
#include "core/sampling.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

namespace afterglow {
namespace {

constexpr Index pixels_at_once = 4096, patches_at_once = 64;
constexpr int places_compared = 4; // beside the first

/// Sum of |a - b| over two rows by increasing id.
float row_difference(std::span<const BasisEntry> a, std::span<const BasisEntry> b) {
    float sum = 0.0f;
    std::size_t i = 0, k = 0;
    while (i < a.size() || k < b.size()) {
        if (k == b.size() || (i < a.size() && a[i].index < b[k].index))
            sum += a[i++].value;
        else if (i == a.size() || b[k].index < a[i].index)
            sum += b[k++].value;
        else
            sum += std::abs(a[i++].value - b[k++].value);
    }
    return sum;
}

} // namespace

DisplayPatches::DisplayPatches(const ShepardBasis& basis, int level, const Options& options)
    : basis_(basis), level_(level), options_(options), table_(1024) {}

std::uint64_t DisplayPatches::Cell::key() const {
    const auto word = [](std::int64_t high, std::int64_t low) {
        return static_cast<std::uint64_t>(high) << 32 | static_cast<std::uint32_t>(low);
    };
    // 4 x 4 x 4 cubes share a hash, and differ in its last bits: neighbours lie close in the table.
    const std::uint64_t block = hash64(
        hash64(word(size_exponent, surface), word(cube[0] >> 2, cube[1] >> 2)), word(0, cube[2] >> 2));
    const auto within = static_cast<std::uint64_t>((cube[0] & 3) | (cube[1] & 3) << 2 | (cube[2] & 3) << 4);
    const std::uint64_t key = (block & ~std::uint64_t{63}) | within;
    return key != 0 ? key : 64;
}

DisplayPatches::Cell DisplayPatches::cell(const PixelSurfaces& pixels, std::size_t pixel,
                                          float size_in_pixels) const {
    const Vec3 x = Vec3::Map(pixels.position[pixel].data());
    // Not so small that the numbers of the cubes would not fit.
    const float size = std::max(size_in_pixels * pixels.pixel_size * (x - pixels.eye).norm(),
                                x.cwiseAbs().maxCoeff() * 0x1p-28f);
    Cell cell{pixels.surface[pixel], size > 0.0f ? std::ilogb(size) : 0, {}};
    const float scale = std::ldexp(1.0f, -cell.size_exponent);
    for (int a = 0; a < 3; ++a) cell.cube[a] = static_cast<std::int32_t>(std::floor(scale * x[a]));
    return cell;
}

std::uint32_t DisplayPatches::look_up(std::uint64_t key) const {
    const std::size_t mask = table_.size() - 1;
    for (std::size_t k = key & mask;; k = (k + 1) & mask) {
        if (table_[k].key == key) return table_[k].patch;
        if (table_[k].key == 0) return no_index;
    }
}

void DisplayPatches::insert(std::uint64_t key, std::uint32_t patch) {
    const auto put = [this](const Slot& slot) {
        const std::size_t mask = table_.size() - 1;
        std::size_t k = slot.key & mask;
        while (table_[k].key != 0) k = (k + 1) & mask;
        table_[k] = slot;
    };
    if (2 * (patches() + 1) > table_.size()) {
        std::vector<Slot> old(2 * table_.size());
        old.swap(table_);
        for (const Slot& slot : old)
            if (slot.key != 0) put(slot);
    }
    put({key, patch});
}

void DisplayPatches::forget_all() {
    std::fill(table_.begin(), table_.end(), Slot{});
    begin_.assign(1, 0);
    entries_.clear();
    patch_.clear();
    ++generation_;
}

void DisplayPatches::WantedLists::append(const WantedLists& more) {
    large.insert(large.end(), more.large.begin(), more.large.end());
    untested.insert(untested.end(), more.untested.begin(), more.untested.end());
    small.insert(small.end(), more.small.begin(), more.small.end());
    small_pixels.insert(small_pixels.end(), more.small_pixels.begin(), more.small_pixels.end());
}

DisplayPatches::WantedLists DisplayPatches::look(const PixelSurfaces& pixels,
                                                 std::span<const std::uint32_t> which,
                                                 double small_share,
                                                 std::span<std::uint32_t> patch) const {
    const auto largest = static_cast<std::uint32_t>(small_share * 0xffffffffu);
    const auto count = static_cast<Index>(which.size());
    std::vector<WantedLists> wanted(
        static_cast<std::size_t>((count + pixels_at_once - 1) / pixels_at_once));
    parallel_ranges(count, pixels_at_once, [&](Index begin, Index end) {
        WantedLists& here = wanted[static_cast<std::size_t>(begin / pixels_at_once)];
        Cell large;
        std::uint64_t key = 0;
        std::uint32_t found = no_index;
        for (Index i = begin; i < end; ++i) {
            const std::uint32_t p = which[static_cast<std::size_t>(i)];
            patch[p] = no_index;
            if (pixels.surface[p] == no_index) continue;
            if (const Cell c = cell(pixels, p, options_.patch_pixels); c != large) {
                large = c;
                key = c.key();
                found = look_up(key);
            }
            patch[p] = found;
            if (found == no_index) {
                here.large.push_back({key, p, large.size_exponent});
            } else if (!patch_[found].is_delicate()) {
                if (patch_[found].distance2(pixels.position[p]) > patch_[found].alike2)
                    here.untested.push_back({key, p, large.size_exponent});
            } else {
                const Cell small = cell(pixels, p, options_.small_pixels);
                const std::uint64_t small_key = small.key();
                if (const std::uint32_t s = look_up(small_key); s != no_index) {
                    patch[p] = s;
                    continue;
                }
                here.small_pixels.push_back(p);
                if (static_cast<std::uint32_t>(hash64(small_key, calls_)) <= largest)
                    here.small.push_back({small_key, p, small.size_exponent});
            }
        }
    });
    WantedLists all;
    for (const WantedLists& w : wanted) all.append(w);
    return all;
}

std::vector<DisplayPatches::Group> DisplayPatches::group(std::vector<Wanted>& wanted) {
    std::sort(wanted.begin(), wanted.end(), [](const Wanted& a, const Wanted& b) {
        return a.key != b.key ? a.key < b.key : a.pixel < b.pixel;
    });
    std::vector<Group> groups;
    for (std::size_t first = 0, end = 0; first < wanted.size(); first = end) {
        while (end < wanted.size() && wanted[end].key == wanted[first].key) ++end;
        groups.emplace_back(&wanted[first], end - first);
    }
    return groups;
}

std::vector<DisplayPatches::Group> DisplayPatches::chosen(std::span<const Group> groups,
                                                          std::size_t count) {
    std::vector<Group> first(groups.begin(), groups.begin() + static_cast<std::ptrdiff_t>(count));
    std::sort(first.begin(), first.end(), [](const Group& a, const Group& b) {
        return a.front().pixel < b.front().pixel;
    });
    return first;
}

std::size_t DisplayPatches::find(const PixelSurfaces& pixels, std::size_t most_new,
                                 std::vector<std::uint32_t>& patch) {
    patch.resize(pixels.surface.size());
    std::vector<std::uint32_t> all(patch.size());
    std::iota(all.begin(), all.end(), 0u);
    return serve(pixels, all, most_new, patch);
}

std::size_t DisplayPatches::refine(const PixelSurfaces& pixels, std::size_t most_new,
                                   std::vector<std::uint32_t>& patch) {
    // As many as can be served; the others wait on.
    std::vector<std::uint32_t> waiting = std::move(waiting_);
    const std::size_t served = std::min(waiting.size(), std::max<std::size_t>(most_new, 1000));
    const std::uint64_t generation = generation_;
    serve(pixels, std::span(waiting).first(served), most_new, patch);
    if (generation_ == generation)
        waiting_.insert(waiting_.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(served), waiting.end());
    small_waiting_ = waiting_.size();
    return waiting_.size();
}

std::size_t DisplayPatches::serve(const PixelSurfaces& pixels, std::span<const std::uint32_t> which,
                                  std::size_t most_new, std::vector<std::uint32_t>& patch) {
    const auto pixels_of = [](std::span<const Group> groups) {
        std::vector<std::uint32_t> list;
        for (const Group& g : groups)
            for (const Wanted& w : g) list.push_back(w.pixel);
        return list;
    };
    ++calls_;
    // As many small patches are wanted as pixels waited, or fewer: twice what is needed will do.
    const double small_share = std::min(1.0, 2.0 * static_cast<double>(most_new)
                                                 / static_cast<double>(std::clamp<std::size_t>(small_waiting_, 1, which.size() + 1)));
    WantedLists wanted = look(pixels, which, small_share, patch);

    // Of which one view, with a large and a small one at each pixel, never needs more.
    const std::size_t limit = std::max(options_.most_patches, 2 * patch.size());
    const auto anew = [&] {
        forget_all();
        return find(pixels, most_new, patch);
    };
    std::vector<Group> large = group(wanted.large);
    large = chosen(large, large.size());
    if (patches() + large.size() > limit) return anew();
    make(pixels, large);
    wanted.append(look(pixels, pixels_of(large), small_share, patch));

    const std::vector<Group> untested = group(wanted.untested);
    const std::size_t tested = std::min(untested.size(), most_new / places_compared);
    const std::vector<Group> to_test = chosen(untested, tested);
    test(pixels, to_test);
    wanted.append(look(pixels, pixels_of(to_test), small_share, patch));

    const std::vector<Group> small = group(wanted.small);
    const std::size_t made = std::min(small.size(), most_new - tested * places_compared);
    if (patches() + made > limit) return anew();
    const std::vector<Group> to_make = chosen(small, made);
    make(pixels, to_make);
    const std::vector<std::uint32_t> done = pixels_of(to_make);
    look(pixels, done, 0.0, patch);

    std::vector<bool> is_done(patch.size());
    for (const std::uint32_t p : done) is_done[p] = true;
    waiting_ = pixels_of(std::span(untested).subspan(tested));
    const std::size_t untested_pixels = waiting_.size();
    std::copy_if(wanted.small_pixels.begin(), wanted.small_pixels.end(), std::back_inserter(waiting_),
                 [&](std::uint32_t p) { return !is_done[p]; });
    small_waiting_ = waiting_.size() - untested_pixels;
    return waiting_.size();
}

void DisplayPatches::make(const PixelSurfaces& pixels, std::span<const Group> groups) {
    struct Rows {
        std::vector<BasisEntry> entries;
        std::vector<std::size_t> end;
    };
    const auto count = static_cast<Index>(groups.size());
    std::vector<Rows> made(static_cast<std::size_t>((count + patches_at_once - 1) / patches_at_once));
    parallel_ranges(count, patches_at_once, [&](Index begin, Index end) {
        Rows& rows = made[static_cast<std::size_t>(begin / patches_at_once)];
        for (Index k = begin; k < end; ++k) {
            const Wanted& w = groups[static_cast<std::size_t>(k)].front();
            const float diagonal = std::sqrt(3.0f) * std::ldexp(1.0f, w.size_exponent);
            basis_.factors(level_, pixels.point(w.pixel), diagonal, rows.entries);
            rows.end.push_back(rows.entries.size());
        }
    });
    std::size_t next = 0;
    for (const Rows& rows : made) {
        const std::size_t first = entries_.size();
        entries_.insert(entries_.end(), rows.entries.begin(), rows.entries.end());
        for (const std::size_t end : rows.end) {
            const Wanted& w = groups[next++].front();
            const PixelSurfaces::Float4& x = pixels.position[w.pixel];
            insert(w.key, static_cast<std::uint32_t>(patches()));
            begin_.push_back(static_cast<std::uint32_t>(first + end));
            patch_.push_back({{x[0], x[1], x[2]}, 0.0f});
        }
    }
}

void DisplayPatches::test(const PixelSurfaces& pixels, std::span<const Group> groups) {
    std::vector<float> alike2(groups.size());
    parallel_for(static_cast<Index>(groups.size()), [&](Index k) {
        alike2[static_cast<std::size_t>(k)] = compared(pixels, groups[static_cast<std::size_t>(k)]);
    }, patches_at_once);
    for (std::size_t k = 0; k < groups.size(); ++k)
        patch_[look_up(groups[k].front().key)].alike2 = alike2[k];
}

float DisplayPatches::compared(const PixelSurfaces& pixels, const Group& group) const {
    const std::uint32_t number = look_up(group.front().key);
    const std::span<const BasisEntry> factors = functions(number);
    // How far each pixel is from the closest place that was looked at.
    std::vector<float> distance2(group.size());
    for (std::size_t k = 0; k < group.size(); ++k)
        distance2[k] = patch_[number].distance2(pixels.position[group[k].pixel]);
    const float farthest2 = *std::max_element(distance2.begin(), distance2.end());
    std::vector<BasisEntry> here, expected;
    for (int n = 0; n < places_compared; ++n) {
        const auto seen = static_cast<std::size_t>(
            std::max_element(distance2.begin(), distance2.end()) - distance2.begin());
        if (distance2[seen] == 0.0f) break;
        const SurfacePoint x = pixels.point(group[seen].pixel);
        here.clear();
        expected.clear();
        basis_.evaluate_or_nearest(level_, x, here);
        basis_.apply_factors(factors, x, expected);
        if (row_difference(here, expected) > options_.tolerance) return -1.0f;
        for (std::size_t k = 0; k < group.size(); ++k)
            distance2[k] = std::min(distance2[k], (pixels.point(group[k].pixel).position - x.position).squaredNorm());
    }
    // A little farther, so that not every pixel more is looked at.
    const float pixel = pixels.pixel_size * (pixels.point(group.front().pixel).position - pixels.eye).norm();
    const float alike = std::sqrt(farthest2) + 0.25f * pixel;
    return std::max(patch_[number].alike2, alike * alike);
}

} // namespace afterglow
