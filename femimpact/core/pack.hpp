// Several doubles in one register. A function that is written for `Value` serves a number and a pack, with the same
// rounding.
#pragma once

#include "array.hpp"

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
