#pragma once

#include "basis/shepard_basis.h"

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace afterglow {

/// What the pixels of a free camera show, row by row from the top, as a geometry buffer holds it.
struct PixelSurfaces {
    using Float4 = std::array<float, 4>;
    int width = 0, height = 0;
    Vec3 eye = Vec3::Zero();  // [world]
    float pixel_size = 0.0f;  // of a pixel at distance one, 2 tan(fov / 2) / height
    std::span<const Float4> position; // [world]; the fourth is not looked at
    std::span<const Float4> normal;   // unit length, of interpolated normals, on the viewer's side
    std::span<const std::uint32_t> surface; // 2 * triangle + back side, however they are numbered;
                                            // no_index: nothing is there

    SurfacePoint point(std::size_t pixel) const {
        return {Vec3::Map(position[pixel].data()), Vec3::Map(normal[pixel].data())};
    }
};

/// The display level's weights at every pixel of a camera that moves. What is costly in them, the
/// openness and the sight of functions (ShepardBasis::factors), is found once for a *patch* of a
/// surface and kept; the kernel and the cosine are evaluated at each pixel.
///
/// A patch is the part of a triangle in a cube of a world grid, whose edges are powers of two. Its
/// factors are found at the first pixel that shows it, and compared with those at the four farthest,
/// again when pixels show more of it: where the rows there differ by more than `tolerance` (the sum of
/// |differences|), as beside edges and contacts, the patch is *delicate*, and there are smaller ones in
/// it, as large as a pixel. Where these are not there yet the large one does, so that a frame need not
/// wait for all.
class DisplayPatches {
public:
    struct Options {
        float patch_pixels = 8.0f; // the longest edge of a cube, in pixels at the pixel's distance
        float small_pixels = 0.5f; // the same of the small patches
        float tolerance = 0.1f;
        /// ~140 bytes each; beyond that, and two a pixel, all are forgotten.
        std::size_t most_patches = 2'000'000;
    };
    static constexpr std::size_t no_limit = std::numeric_limits<std::size_t>::max();

    /// level: of `basis`, to which a reference is kept.
    DisplayPatches(const ShepardBasis& basis, int level, const Options& options);

    /// Writes the patch of each pixel (no_index where there is no surface), and makes those that are
    /// missing, evaluating factors at about `most_new` places beyond one a large patch (5 to 30 us each
    /// and thread). Returns how many pixels still wait for their right patch. The same calls in the same
    /// order give the same patches at any number of threads.
    std::size_t find(const PixelSurfaces& pixels, std::size_t most_new,
                     std::vector<std::uint32_t>& patch);

    /// Goes on with the same pixels, and the same `patch`, where the last find() or refine() left some
    /// waiting; the time is that of the patches alone.
    std::size_t refine(const PixelSurfaces& pixels, std::size_t most_new,
                       std::vector<std::uint32_t>& patch);

    std::size_t patches() const { return begin_.size() - 1; }
    /// The functions of a patch by increasing id, with o_j v_j as their values; none where it is not
    /// covered.
    std::span<const BasisEntry> functions(std::uint32_t patch) const {
        return {entries_.data() + begin_[patch], entries_.data() + begin_[patch + 1]};
    }
    /// All patches in rows, for a copy on the GPU: row i is entries[begin[i] .. begin[i + 1]). Rows are
    /// only added, unless `generation` has changed.
    std::span<const std::uint32_t> begin() const { return begin_; }
    std::span<const BasisEntry> entries() const { return entries_; }
    std::uint64_t generation() const { return generation_; }

private:
    struct Patch {
        std::array<float, 3> place = {}; // where its factors were found [world]
        /// So far from it factors are known to be alike [world^2]; below zero where it is delicate. Small ones come
        /// untested: they may be large ones of a closer camera.
        float alike2 = 0.0f;
        bool is_delicate() const { return alike2 < 0.0f; }
        float distance2(const PixelSurfaces::Float4& x) const {
            const float a = x[0] - place[0], b = x[1] - place[1], c = x[2] - place[2];
            return a * a + b * b + c * c;
        }
    };
    struct Cell {
        std::uint32_t surface = no_index;
        int size_exponent = 0; // the cube's edge is 2^size_exponent [world]
        std::array<std::int32_t, 3> cube = {};
        bool operator==(const Cell&) const = default;
        std::uint64_t key() const;
    };
    /// A pixel whose patch is not there, or not tested.
    struct Wanted {
        std::uint64_t key = 0;
        std::uint32_t pixel = 0;
        int size_exponent = 0;
    };
    struct WantedLists {
        std::vector<Wanted> large, untested, small;
        std::vector<std::uint32_t> small_pixels; // whose patch is in the list or not
        void append(const WantedLists& more);
    };
    /// Pixels that want the same patch.
    using Group = std::span<const Wanted>;
    /// Open addressing; keys are hashes of 64 bits that are taken to differ.
    struct Slot {
        std::uint64_t key = 0; // 0: free
        std::uint32_t patch = no_index;
    };

    const ShepardBasis& basis_;
    int level_;
    Options options_;
    std::vector<Slot> table_;
    std::vector<std::uint32_t> begin_ = {0};
    std::vector<BasisEntry> entries_;
    std::vector<Patch> patch_;
    std::uint64_t generation_ = 0;
    std::vector<std::uint32_t> waiting_; // pixels, after the last find() or refine()
    std::size_t small_waiting_ = 0;      // those of them that wait for a small patch
    std::uint64_t calls_ = 0;            // each draws other patches by lot

    Cell cell(const PixelSurfaces& pixels, std::size_t pixel, float size_in_pixels) const;
    std::uint32_t look_up(std::uint64_t key) const;
    void insert(std::uint64_t key, std::uint32_t patch);
    /// Writes the patches of some pixels as they are now, and says what is wanted for them; of the small
    /// patches about the given share, as there may be many more than can be made.
    WantedLists look(const PixelSurfaces& pixels, std::span<const std::uint32_t> which,
                     double small_share, std::span<std::uint32_t> patch) const;
    /// Patches for these pixels, as find() says.
    std::size_t serve(const PixelSurfaces& pixels, std::span<const std::uint32_t> which,
                      std::size_t most_new, std::vector<std::uint32_t>& patch);
    /// By key, which is as good as at random.
    static std::vector<Group> group(std::vector<Wanted>& wanted);
    /// The first `count`, thus all over the picture, in the order of their pixels, so that what lies
    /// close is made together and lies close in memory.
    static std::vector<Group> chosen(std::span<const Group> groups, std::size_t count);
    /// A patch for each group, from the first of its pixels.
    void make(const PixelSurfaces& pixels, std::span<const Group> groups);
    void test(const PixelSurfaces& pixels, std::span<const Group> groups);
    /// How far factors are alike, now that these pixels show it: see Patch.
    float compared(const PixelSurfaces& pixels, const Group& group) const;
    void forget_all();
};

} // namespace afterglow
