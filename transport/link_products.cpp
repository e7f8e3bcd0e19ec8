#include "transport/link_products.h"

#include <algorithm>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

namespace afterglow {
namespace {

/// Steps from sender to sender of a row, counted from -1.
struct RowSteps {
    std::uint64_t sum = 0;
    bool has_zero = false;

    void add(std::span<const PackedLink> entries) {
        for (const PackedLink& packed : entries) {
            const std::uint32_t step = Links::step_of(Links::bits_of(packed));
            has_zero |= step == 0;
            sum += step;
        }
    }
    bool are_sound(std::uint32_t senders) const { return !has_zero && sum <= senders; }
};

} // namespace

#if defined(__AVX2__) && defined(__FMA__)

namespace {

constexpr std::size_t width = 8; // links that are decoded at a time

/// Stays in a register, or is read from the stack, instead of being made anew in each round of a loop.
__m256i kept(__m256i constant) {
    asm("" : "+x"(constant));
    return constant;
}

/// x, y and z of eight links, decoded from their bits.
struct EightLinks {
    __m256 x, y, z;
    static __m256i exponent_bits() { return kept(_mm256_set1_epi32(31 << 23)); }
    static __m256i bias() { return kept(_mm256_set1_epi32((127 - 31) << 23)); }

    /// exponent << shift is where floats have theirs; x, y and z are the highest, four bits each from
    /// `first` on.
    template <int shift, int first>
    static EightLinks decode(__m256i bits, __m256i exponent_bits, __m256i bias) {
        const auto component = [&](int left) {
            return _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(bits, left), 28));
        };
        const __m256i exponent = _mm256_and_si256(_mm256_slli_epi32(bits, shift), exponent_bits);
        const __m256 step = _mm256_castsi256_ps(_mm256_add_epi32(exponent, bias));
        return {_mm256_mul_ps(component(28 - first), step), _mm256_mul_ps(component(24 - first), step),
                _mm256_mul_ps(component(20 - first), step)};
    }
};

/// Element k of each half in all places of that half.
template <int k>
__m256 spread(__m256 v) {
    return _mm256_permute_ps(v, k * 0x55);
}

/// Sums of two rows of products, a half each.
struct PairSum {
    __m256 x = _mm256_setzero_ps(), y = _mm256_setzero_ps(), z = _mm256_setzero_ps();

    /// Links k and k + 4 of eight; of the senders twice their numbers, as what is read is addressed by eights.
    template <int k>
    void add(const EightLinks& links, const float* coefficients, const std::uint32_t* twice) {
        const auto* const pairs = reinterpret_cast<const std::array<float, 2>*>(coefficients);
        const __m256 c =
            _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(reinterpret_cast<const float*>(pairs + twice[k]))),
                                 _mm_loadu_ps(reinterpret_cast<const float*>(pairs + twice[k + 4])), 1);
        x = _mm256_fmadd_ps(spread<k>(links.x), c, x);
        y = _mm256_fmadd_ps(spread<k>(links.y), c, y);
        z = _mm256_fmadd_ps(spread<k>(links.z), c, z);
    }
};

__m128 sum_of_halves(__m256 v) {
    return _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
}

/// Running sums over eight integers.
__m256i running_sums(__m256i v) {
    v = _mm256_add_epi32(v, _mm256_slli_si256(v, 4));
    v = _mm256_add_epi32(v, _mm256_slli_si256(v, 8)); // of each half
    const __m256i totals = _mm256_shuffle_epi32(v, 0xff);
    return _mm256_add_epi32(v, _mm256_permute2x128_si256(totals, totals, 0x08));
}

/// The bits of eight entries, 24 each.
__m256i bits_of_eight(const PackedLink* from) {
    const __m256i spread_bytes =
        _mm256_setr_epi8(0, 1, 2, -1, 3, 4, 5, -1, 6, 7, 8, -1, 9, 10, 11, -1, //
                         4, 5, 6, -1, 7, 8, 9, -1, 10, 11, 12, -1, 13, 14, 15, -1);
    const auto half = [&](std::size_t byte) {
        return _mm_loadu_si128(reinterpret_cast<const __m128i*>(reinterpret_cast<const char*>(from) + byte));
    };
    return _mm256_shuffle_epi8(_mm256_inserti128_si256(_mm256_castsi128_si256(half(0)), half(8), 1), spread_bytes);
}

/// Their steps from sender to sender.
class Steps {
public:
    __m256i of(__m256i bits) const {
        return _mm256_and_si256(
            bits, _mm256_or_si256(_mm256_and_si256(_mm256_cmpgt_epi32(least_link_, bits), jump_), step_));
    }

private:
    __m256i least_link_ = kept(_mm256_set1_epi32(1 << 12)), jump_ = kept(_mm256_set1_epi32(4095)),
            step_ = kept(_mm256_set1_epi32(127));
};

} // namespace

LinkProduct multiply_row(const Links& links, Index row, const float* coefficients) {
    const PackedLink* at = links.entry.data() + links.begin[static_cast<std::size_t>(row)];
    const PackedLink* const end = links.entry.data() + links.begin[static_cast<std::size_t>(row) + 1];
    const Steps steps;
    const __m256i exponent_bits = EightLinks::exponent_bits(), bias = EightLinks::bias();
    const __m256i seven = kept(_mm256_set1_epi32(7));
    PairSum even, odd;
    __m256i last = _mm256_set1_epi32(-1); // sender
    const auto add = [&](__m256i bits) __attribute__((always_inline)) {
        const __m256i sums = running_sums(steps.of(bits));
        alignas(32) std::array<std::uint32_t, width> twice;
        const __m256i sender = _mm256_add_epi32(sums, last);
        _mm256_store_si256(reinterpret_cast<__m256i*>(twice.data()), _mm256_add_epi32(sender, sender));
        asm("" : "+m"(twice)); // from memory on, not element by element out of the register
        last = _mm256_add_epi32(last, _mm256_permutevar8x32_epi32(sums, seven));

        const auto eight = EightLinks::decode<16, 12>(bits, exponent_bits, bias);
        even.add<0>(eight, coefficients, twice.data());
        odd.add<1>(eight, coefficients, twice.data());
        even.add<2>(eight, coefficients, twice.data());
        odd.add<3>(eight, coefficients, twice.data());
    };
    for (; end - at >= static_cast<std::ptrdiff_t>(width); at += width) add(bits_of_eight(at));
    if (at < end) { // the rest, and jumps of no length
        std::array<PackedLink, width> rest = {};
        std::copy(at, end, rest.begin());
        add(bits_of_eight(rest.data()));
    }
    LinkProduct sum;
    _mm_storeu_ps(&sum[0], sum_of_halves(_mm256_add_ps(even.x, odd.x)));
    _mm_storeu_ps(&sum[4], sum_of_halves(_mm256_add_ps(even.y, odd.y)));
    _mm_storeu_ps(&sum[8], sum_of_halves(_mm256_add_ps(even.z, odd.z)));
    return sum;
}

bool is_sound_row(const Links& links, Index row, std::uint32_t senders) {
    const std::span<const PackedLink> entries = links.row(row);
    const Steps steps;
    constexpr std::size_t most = std::size_t{1} << 22; // of whose steps the sum is below 2^32 in each lane
    RowSteps row_steps;
    std::size_t k = 0;
    while (entries.size() - k >= width) {
        __m256i sums = _mm256_setzero_si256(), zeros = sums;
        for (const std::size_t end = std::min(entries.size(), k + most); end - k >= width; k += width) {
            const __m256i step = steps.of(bits_of_eight(&entries[k]));
            sums = _mm256_add_epi32(sums, step);
            zeros = _mm256_or_si256(zeros, _mm256_cmpeq_epi32(step, _mm256_setzero_si256()));
        }
        std::array<std::uint32_t, width> lanes;
        _mm256_storeu_si256(reinterpret_cast<__m256i*>(lanes.data()), sums);
        for (const std::uint32_t lane : lanes) row_steps.sum += lane;
        row_steps.has_zero |= _mm256_testz_si256(zeros, zeros) == 0;
    }
    row_steps.add(entries.subspan(k));
    return row_steps.are_sound(senders);
}

namespace {

/// Link k of each half onto a receiver's product; xy: x of four links, and y of the same.
template <int k>
void add_link(__m256 xy, __m128 z, __m256 coefficient, float* product) {
    _mm256_storeu_ps(product, _mm256_fmadd_ps(spread<k>(xy), coefficient, _mm256_loadu_ps(product)));
    _mm_storeu_ps(product + 8, _mm_fmadd_ps(_mm_permute_ps(z, k * 0x55), _mm256_castps256_ps128(coefficient),
                                            _mm_loadu_ps(product + 8)));
}

} // namespace

void add_column(std::span<const ColumnLink> links, const float* coefficient, float* products) {
    if (links.empty()) return;
    const __m256 c = _mm256_broadcast_ps(reinterpret_cast<const __m128*>(coefficient));
    const __m256i receiver_bits = kept(_mm256_set1_epi32(ColumnLink::block_size - 1));
    const __m256i exponent_bits = EightLinks::exponent_bits(), bias = EightLinks::bias();
    // `product`: where that of receiver k of eight is.
    const auto add = [&](__m256i bits, std::size_t count, const auto& product) __attribute__((always_inline)) {
        const auto eight = EightLinks::decode<10, 18>(bits, exponent_bits, bias);
        alignas(32) std::array<std::uint32_t, width> receiver;
        _mm256_store_si256(reinterpret_cast<__m256i*>(receiver.data()), _mm256_and_si256(bits, receiver_bits));
        asm("" : "+m"(receiver));
        const __m256 first = _mm256_permute2f128_ps(eight.x, eight.y, 0x20);
        const __m256 second = _mm256_permute2f128_ps(eight.x, eight.y, 0x31);
        const __m128 first_z = _mm256_castps256_ps128(eight.z), second_z = _mm256_extractf128_ps(eight.z, 1);
        add_link<0>(first, first_z, c, product(0, receiver[0]));
        add_link<1>(first, first_z, c, product(1, receiver[1]));
        add_link<2>(first, first_z, c, product(2, receiver[2]));
        add_link<3>(first, first_z, c, product(3, receiver[3]));
        if (count <= 4) return;
        add_link<0>(second, second_z, c, product(4, receiver[4]));
        add_link<1>(second, second_z, c, product(5, receiver[5]));
        add_link<2>(second, second_z, c, product(6, receiver[6]));
        add_link<3>(second, second_z, c, product(7, receiver[7]));
    };
    const ColumnLink* at = links.data();
    const ColumnLink* const end = at + links.size();
    for (; end - at >= static_cast<std::ptrdiff_t>(width); at += width)
        add(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)), width,
            [&](std::size_t, std::uint32_t receiver) { return products + 12 * std::size_t{receiver}; });
    if (at == end) return;
    const auto rest = static_cast<std::size_t>(end - at);
    const __m256i mask = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(rest)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    alignas(32) std::array<float, 48> beyond = {}; // onto which links are added that are not there
    add(_mm256_maskload_epi32(reinterpret_cast<const int*>(at), mask), rest, [&](std::size_t k, std::uint32_t receiver) {
        return k < rest ? products + 12 * std::size_t{receiver} : &beyond[12 * (k % 4)];
    });
}

#else

LinkProduct multiply_row(const Links& links, Index row, const float* coefficients) {
    Eigen::Array<float, 4, 3> sum = Eigen::Array<float, 4, 3>::Zero();
    links.for_each(row, [&](std::uint32_t sender, const LinkVector& link) {
        for (int a = 0; a < 3; ++a)
            sum.col(a) += link[a] * Eigen::Array4f::Map(coefficients + 4 * std::size_t{sender});
    });
    LinkProduct product;
    Eigen::Array<float, 4, 3>::Map(product.data()) = sum;
    return product;
}

bool is_sound_row(const Links& links, Index row, std::uint32_t senders) {
    RowSteps steps;
    steps.add(links.row(row));
    return steps.are_sound(senders);
}

void add_column(std::span<const ColumnLink> links, const float* coefficient, float* products) {
    for (const ColumnLink& packed : links) {
        const LinkVector link = packed.vector();
        float* const product = products + 12 * std::size_t{packed.receiver()};
        for (int a = 0; a < 3; ++a)
            Eigen::Array4f::Map(product + 4 * a) += link[a] * Eigen::Array4f::Map(coefficient);
    }
}

#endif

} // namespace afterglow
