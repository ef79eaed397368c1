// Several doubles in one register. A function that is written for `Value` serves a number and a pack, with the same
// rounding.
#pragma once

#include "array.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace FEMIMPACT_TARGET {

// Doubles in a register of the processor that this is compiled for.
#if defined(__AVX512F__)
constexpr int LANES = 8;
#elif defined(__AVX__)
constexpr int LANES = 4;
#else
constexpr int LANES = 2;
#endif

template <int W> struct Lanes {
    typedef double Real __attribute__((vector_size(8 * W)));
    // unsigned: what is added to the bits of a number may pass beyond their range
    typedef unsigned long long Whole __attribute__((vector_size(8 * W)));
};

// ---- eight cases side by side -----------------------------------------------------------------------

constexpr int WIDTH = 8;

// Eight doubles in 1, 2 or 4 registers.
struct Pack {
    static constexpr int COUNT = WIDTH / LANES;
    Lanes<LANES>::Real part[COUNT];
};

// Where a condition holds: all bits of a lane are set, or none.
struct PackMask {
    Lanes<LANES>::Whole part[Pack::COUNT];
};

#define FEMIMPACT_EACH_PART for (int i = 0; i < Pack::COUNT; i++)

#define FEMIMPACT_OPERATOR(op)                                                                                         \
    [[gnu::always_inline]] inline Pack operator op(Pack a, Pack b) {                                                   \
        FEMIMPACT_EACH_PART a.part[i] = a.part[i] op b.part[i];                                                        \
        return a;                                                                                                      \
    }                                                                                                                  \
    [[gnu::always_inline]] inline Pack operator op(double a, Pack b) {                                                 \
        FEMIMPACT_EACH_PART b.part[i] = a op b.part[i];                                                                \
        return b;                                                                                                      \
    }                                                                                                                  \
    [[gnu::always_inline]] inline Pack operator op(Pack a, double b) {                                                 \
        FEMIMPACT_EACH_PART a.part[i] = a.part[i] op b;                                                                \
        return a;                                                                                                      \
    }
FEMIMPACT_OPERATOR(+)
FEMIMPACT_OPERATOR(-)
FEMIMPACT_OPERATOR(*)
#undef FEMIMPACT_OPERATOR

[[gnu::always_inline]] inline Pack operator-(Pack a) {
    FEMIMPACT_EACH_PART a.part[i] = -a.part[i];
    return a;
}

#define FEMIMPACT_COMPARISON(op)                                                                                       \
    [[gnu::always_inline]] inline PackMask operator op(Pack a, Pack b) {                                               \
        PackMask found;                                                                                                \
        FEMIMPACT_EACH_PART found.part[i] = (Lanes<LANES>::Whole)(a.part[i] op b.part[i]);                             \
        return found;                                                                                                  \
    }
FEMIMPACT_COMPARISON(<)
FEMIMPACT_COMPARISON(>)
#undef FEMIMPACT_COMPARISON

[[gnu::always_inline]] inline PackMask operator|(PackMask a, PackMask b) {
    FEMIMPACT_EACH_PART a.part[i] |= b.part[i];
    return a;
}

// The first where the condition holds, else the second.
[[gnu::always_inline]] inline double chosen(bool where, double a, double b) {
    return where ? a : b;
}
[[gnu::always_inline]] inline Pack chosen(PackMask where, Pack a, Pack b) {
    FEMIMPACT_EACH_PART a.part[i] = where.part[i] ? a.part[i] : b.part[i];
    return a;
}

[[gnu::always_inline]] inline Pack larger(Pack a, Pack b) {
    return chosen(b > a, b, a);
}
[[gnu::always_inline]] inline Pack smaller(Pack a, Pack b) {
    return chosen(b < a, b, a);
}
[[gnu::always_inline]] inline Pack magnitude(Pack a) {
    FEMIMPACT_EACH_PART {
        auto bits = (Lanes<LANES>::Whole)a.part[i] & 0x7fffffffffffffffULL;
        a.part[i] = (Lanes<LANES>::Real)bits;
    }
    return a;
}

// The lanes of a register whose highest bit is set, as bits.
[[gnu::always_inline]] inline unsigned signs_of(Lanes<LANES>::Whole part) {
#if defined(__AVX512F__)
    return _mm512_movepi64_mask((__m512i)part);
#elif defined(__AVX__)
    return unsigned(_mm256_movemask_pd((__m256d)part));
#elif defined(__x86_64__)
    return unsigned(_mm_movemask_pd((__m128d)part));
#else
    return unsigned(part[0] >> 63) | unsigned(part[1] >> 63) << 1;
#endif
}

// The cases in which a condition holds, as bits.
[[gnu::always_inline]] inline unsigned bits_where(bool where) {
    return where;
}
[[gnu::always_inline]] inline unsigned bits_where(PackMask where) {
    unsigned bits = 0;
    FEMIMPACT_EACH_PART bits |= signs_of(where.part[i]) << (i * LANES);
    return bits;
}

// Whether two values differ in sign in any case; zeros have a sign.
[[gnu::always_inline]] inline bool differ_in_sign(double a, double b) {
    return (__builtin_bit_cast(Index, a) ^ __builtin_bit_cast(Index, b)) < 0;
}
[[gnu::always_inline]] inline bool differ_in_sign(Pack a, Pack b) {
    unsigned bits = 0;
    FEMIMPACT_EACH_PART bits |= signs_of((Lanes<LANES>::Whole)a.part[i] ^ (Lanes<LANES>::Whole)b.part[i]);
    return bits != 0;
}

// A number times a value, plus another value, rounded once.
[[gnu::always_inline]] inline double fma(double number, double value, double to) {
    return __builtin_fma(number, value, to);
}
[[gnu::always_inline]] inline Pack fma(double number, Pack value, Pack to) {
    FEMIMPACT_EACH_PART {
#if defined(__AVX512F__)
        to.part[i] = _mm512_fmadd_pd(_mm512_set1_pd(number), value.part[i], to.part[i]);
#elif defined(__FMA__)
        to.part[i] = _mm256_fmadd_pd(_mm256_set1_pd(number), value.part[i], to.part[i]);
#else
        for (int k = 0; k < LANES; k++)
            to.part[i][k] = __builtin_fma(number, value.part[i][k], to.part[i][k]);
#endif
    }
    return to;
}

// What is left of a value without a number times another one, rounded once.
template <class Value> [[gnu::always_inline]] inline Value without(double number, Value value, Value from) {
    return fma(-number, value, from);
}

// The same number in every case.
template <class Value> [[gnu::always_inline]] inline Value filled(double number) {
    return Value{} + number;
}

// A register's worth of doubles that lie anywhere. Unlike bytes that are copied, they are known to be doubles: what is
// written to them changes no address or length.
typedef double Anywhere __attribute__((vector_size(8 * LANES), aligned(8)));

// A row over the cases from case c on: of one case alone, or of a pack of them.
template <class Value> [[gnu::always_inline]] inline Value load(GivenArray row, Index c);
template <> [[gnu::always_inline]] inline double load<double>(GivenArray row, Index c) {
    return row(c);
}
template <> [[gnu::always_inline]] inline Pack load<Pack>(GivenArray row, Index c) {
    check_index(c, row.size());
    check_index(c + WIDTH - 1, row.size());
    Pack value;
    FEMIMPACT_EACH_PART value.part[i] = *reinterpret_cast<const Anywhere *>(row.data + c + Index(i) * LANES);
    return value;
}
[[gnu::always_inline]] inline void store(double value, Array row, Index c) {
    row(c) = value;
}
[[gnu::always_inline]] inline void store(Pack value, Array row, Index c) {
    check_index(c, row.size());
    check_index(c + WIDTH - 1, row.size());
    FEMIMPACT_EACH_PART *reinterpret_cast<Anywhere *>(row.data + c + Index(i) * LANES) = value.part[i];
}
#undef FEMIMPACT_EACH_PART

// Calls a function of a zero, whose type says for how many cases, and the first of them: for one case alone, or for
// every pack.
template <class Function> [[gnu::always_inline]] inline void over_cases(Index cases, Function function) {
    if (cases == 1)
        function(0.0, Index(0));
    else
        for (Index c = 0; c < cases; c += WIDTH)
            function(Pack{}, c);
}

// ---- complex numbers that lie one after another ------------------------------------------------------

// Whole numbers of the same size, with the bits of a value.
[[gnu::always_inline]] inline unsigned long long bits_of(double value) {
    return __builtin_bit_cast(unsigned long long, value);
}
[[gnu::always_inline]] inline double with_bits(unsigned long long bits, double) {
    return __builtin_bit_cast(double, bits);
}
template <class Real> [[gnu::always_inline]] inline typename Lanes<sizeof(Real) / 8>::Whole bits_of(Real value) {
    return (typename Lanes<sizeof(Real) / 8>::Whole) value;
}
template <class Real> [[gnu::always_inline]] inline Real with_bits(typename Lanes<sizeof(Real) / 8>::Whole bits, Real) {
    return (Real)bits;
}

// Real and imaginary parts of W complex numbers that lie one after another.
template <int W> struct Parts {
    typename Lanes<W>::Real real, imag;
};

template <int W> [[gnu::always_inline]] inline typename Lanes<W>::Real load(const double *from) {
    typename Lanes<W>::Real value;
    __builtin_memcpy(&value, from, sizeof value);
    return value;
}
template <class Real> [[gnu::always_inline]] inline void store(Real value, double *to) {
    __builtin_memcpy(to, &value, sizeof value);
}

template <int W> [[gnu::always_inline]] inline Parts<W> load_parts(const Complex *from);
template <> [[gnu::always_inline]] inline Parts<2> load_parts<2>(const Complex *from) {
    auto a = load<2>(&from[0].real), b = load<2>(&from[1].real);
    return {__builtin_shufflevector(a, b, 0, 2), __builtin_shufflevector(a, b, 1, 3)};
}
#if defined(__AVX__)
template <> [[gnu::always_inline]] inline Parts<4> load_parts<4>(const Complex *from) {
    auto a = load<4>(&from[0].real), b = load<4>(&from[2].real);
    return {__builtin_shufflevector(a, b, 0, 2, 4, 6), __builtin_shufflevector(a, b, 1, 3, 5, 7)};
}
#endif
#if defined(__AVX512F__)
template <> [[gnu::always_inline]] inline Parts<8> load_parts<8>(const Complex *from) {
    auto a = load<8>(&from[0].real), b = load<8>(&from[4].real);
    return {__builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14),
            __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15)};
}
#endif

[[gnu::always_inline]] inline void store_parts(Parts<2> value, Complex *to) {
    store(__builtin_shufflevector(value.real, value.imag, 0, 2), &to[0].real);
    store(__builtin_shufflevector(value.real, value.imag, 1, 3), &to[1].real);
}
#if defined(__AVX__)
[[gnu::always_inline]] inline void store_parts(Parts<4> value, Complex *to) {
    store(__builtin_shufflevector(value.real, value.imag, 0, 4, 1, 5), &to[0].real);
    store(__builtin_shufflevector(value.real, value.imag, 2, 6, 3, 7), &to[2].real);
}
#endif
#if defined(__AVX512F__)
[[gnu::always_inline]] inline void store_parts(Parts<8> value, Complex *to) {
    store(__builtin_shufflevector(value.real, value.imag, 0, 8, 1, 9, 2, 10, 3, 11), &to[0].real);
    store(__builtin_shufflevector(value.real, value.imag, 4, 12, 5, 13, 6, 14, 7, 15), &to[4].real);
}
#endif

} // namespace FEMIMPACT_TARGET
