#include "transport/link_products.h"

#include <cstring>

#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

namespace afterglow {

#if defined(__AVX2__) && defined(__FMA__)

namespace {

constexpr std::size_t width = 8; // links that are decoded at a time

/// x, y and z of eight links, decoded from their bits.
struct EightLinks {
    __m256 x, y, z;

    /// exponent << shift is where floats have theirs; x, y and z are the highest, four bits each from
    /// `first` on.
    template <int shift, int first>
    static EightLinks decode(__m256i bits) {
        const auto component = [&](int left) {
            return _mm256_cvtepi32_ps(_mm256_srai_epi32(_mm256_slli_epi32(bits, left), 28));
        };
        const __m256i exponent = _mm256_and_si256(_mm256_slli_epi32(bits, shift), _mm256_set1_epi32(31 << 23));
        const __m256 step = _mm256_castsi256_ps(_mm256_add_epi32(exponent, _mm256_set1_epi32((127 - 31) << 23)));
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

    /// Links k and k + 4 of eight.
    template <int k>
    void add(const EightLinks& links, const float* coefficients, const std::uint32_t* sender) {
        const __m256 c = _mm256_insertf128_ps(
            _mm256_castps128_ps256(_mm_loadu_ps(coefficients + 4 * std::size_t{sender[k]})),
            _mm_loadu_ps(coefficients + 4 * std::size_t{sender[k + 4]}), 1);
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

} // namespace

LinkProduct multiply_row(const Links& links, Index row, const float* coefficients) {
    const PackedLink* at = links.entry.data() + links.begin[static_cast<std::size_t>(row)];
    const PackedLink* const end = links.entry.data() + links.begin[static_cast<std::size_t>(row) + 1];
    const PackedLink* const last_read = links.entry.data() + links.entry.size();
    const __m256i spread_bytes =
        _mm256_setr_epi8(0, 1, 2, -1, 3, 4, 5, -1, 6, 7, 8, -1, 9, 10, 11, -1, //
                         4, 5, 6, -1, 7, 8, 9, -1, 10, 11, 12, -1, 13, 14, 15, -1);
    const __m256i number = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    PairSum even, odd;
    __m256i last = _mm256_set1_epi32(-1); // sender
    for (; at < end; at += width) {
        std::array<PackedLink, width> copy; // where eight would reach beyond all
        const PackedLink* from = at;
        if (static_cast<std::size_t>(last_read - at) < width) {
            copy = {};
            std::copy(at, end, copy.begin());
            from = copy.data();
        }
        const auto* bytes = reinterpret_cast<const __m128i*>(from);
        __m256i bits = _mm256_shuffle_epi8(
            _mm256_inserti128_si256(
                _mm256_castsi128_si256(_mm_loadu_si128(bytes)),
                _mm_loadu_si128(reinterpret_cast<const __m128i*>(reinterpret_cast<const char*>(from) + 8)), 1),
            spread_bytes);
        // Beyond the row: jumps of no length.
        if (end - at < static_cast<std::ptrdiff_t>(width))
            bits = _mm256_and_si256(
                bits, _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(end - at)), number));

        const __m256i is_jump = _mm256_cmpgt_epi32(_mm256_set1_epi32(1 << 12), bits);
        const __m256i step = _mm256_and_si256(
            bits, _mm256_or_si256(_mm256_and_si256(is_jump, _mm256_set1_epi32(4095)), _mm256_set1_epi32(127)));
        const __m256i sums = running_sums(step);
        alignas(32) std::array<std::uint32_t, width> sender;
        _mm256_store_si256(reinterpret_cast<__m256i*>(sender.data()), _mm256_add_epi32(sums, last));
        asm("" : "+m"(sender)); // from memory on, not element by element out of the register
        last = _mm256_add_epi32(last, _mm256_permutevar8x32_epi32(sums, _mm256_set1_epi32(7)));

        const auto eight = EightLinks::decode<16, 12>(bits);
        even.add<0>(eight, coefficients, sender.data());
        odd.add<1>(eight, coefficients, sender.data());
        even.add<2>(eight, coefficients, sender.data());
        odd.add<3>(eight, coefficients, sender.data());
    }
    LinkProduct sum;
    _mm_storeu_ps(&sum[0], sum_of_halves(_mm256_add_ps(even.x, odd.x)));
    _mm_storeu_ps(&sum[4], sum_of_halves(_mm256_add_ps(even.y, odd.y)));
    _mm_storeu_ps(&sum[8], sum_of_halves(_mm256_add_ps(even.z, odd.z)));
    return sum;
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
    const __m256 c = _mm256_broadcast_ps(reinterpret_cast<const __m128*>(coefficient));
    const __m256i receiver_bits = _mm256_set1_epi32(ColumnLink::block_size - 1);
    alignas(32) std::array<float, 12 * width> beyond = {}; // where links that there are not are added
    const std::size_t count = links.size();
    for (std::size_t at = 0; at < count; at += width) {
        const std::size_t rest = count - at;
        __m256i bits;
        if (rest >= width) {
            bits = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(&links[at]));
        } else {
            const __m256i mask = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(rest)),
                                                    _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
            bits = _mm256_maskload_epi32(reinterpret_cast<const int*>(&links[at]), mask);
        }
        const auto eight = EightLinks::decode<10, 18>(bits);
        alignas(32) std::array<std::uint32_t, width> receiver;
        _mm256_store_si256(reinterpret_cast<__m256i*>(receiver.data()), _mm256_and_si256(bits, receiver_bits));
        asm("" : "+m"(receiver));
        const auto product = [&](std::size_t k) {
            return k < rest ? products + 12 * std::size_t{receiver[k]} : &beyond[12 * k];
        };
        const __m256 first = _mm256_permute2f128_ps(eight.x, eight.y, 0x20);
        const __m256 second = _mm256_permute2f128_ps(eight.x, eight.y, 0x31);
        const __m128 first_z = _mm256_castps256_ps128(eight.z), second_z = _mm256_extractf128_ps(eight.z, 1);
        add_link<0>(first, first_z, c, product(0));
        add_link<1>(first, first_z, c, product(1));
        add_link<2>(first, first_z, c, product(2));
        add_link<3>(first, first_z, c, product(3));
        if (rest <= 4) break;
        add_link<0>(second, second_z, c, product(4));
        add_link<1>(second, second_z, c, product(5));
        add_link<2>(second, second_z, c, product(6));
        add_link<3>(second, second_z, c, product(7));
    }
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
