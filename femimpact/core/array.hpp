// Arrays that the core is handed, and complex numbers as they lie in them. Nothing here owns memory.
#pragma once

namespace FEMIMPACT_TARGET {

using Index = long long;

constexpr double INFINITE = __builtin_inf();
constexpr double NOT_A_NUMBER = __builtin_nan("");

#ifdef FEMIMPACT_CHECKED
// A checked build ends the process at the first index beyond an array, with the place in the debugger's hands.
[[gnu::always_inline]] inline void check_index(Index i, Index length) {
    if (i < 0 || i >= length)
        __builtin_trap();
}
#else
[[gnu::always_inline]] inline void check_index(Index, Index) {}
#endif

template <class T, int N> struct View;

// A row of contiguous items.
template <class T> struct View<T, 1> {
    T *data;
    Index shape[1];

    [[gnu::always_inline]] Index size() const { return shape[0]; }
    [[gnu::always_inline]] T &operator()(Index i) const {
        check_index(i, shape[0]);
        return data[i];
    }
    // The items from `from` to before `to`.
    [[gnu::always_inline]] View part(Index from, Index to) const { return {data + from, {to - from}}; }
    [[gnu::always_inline]] View first(Index count) const { return part(0, count); }
    // The same items, only to be read.
    template <class U>
        requires(__is_same(U, const T) && !__is_same(U, T))
    [[gnu::always_inline]] operator View<U, 1>() const {
        return {data, {shape[0]}};
    }
};

template <class T> struct View<T, 2> {
    T *data;
    Index shape[2];

    [[gnu::always_inline]] T &operator()(Index i, Index j) const {
        check_index(i, shape[0]);
        check_index(j, shape[1]);
        return data[i * shape[1] + j];
    }
    [[gnu::always_inline]] View<T, 1> row(Index i) const {
        check_index(i, shape[0]);
        return {data + i * shape[1], {shape[1]}};
    }
};

template <class T> struct View<T, 3> {
    T *data;
    Index shape[3];

    [[gnu::always_inline]] T &operator()(Index i, Index j, Index k) const {
        check_index(i, shape[0]);
        check_index(j, shape[1]);
        check_index(k, shape[2]);
        return data[(i * shape[1] + j) * shape[2] + k];
    }
    [[gnu::always_inline]] View<T, 2> row(Index i) const {
        check_index(i, shape[0]);
        return {data + i * shape[1] * shape[2], {shape[1], shape[2]}};
    }
    [[gnu::always_inline]] View<T, 1> row(Index i, Index j) const { return row(i).row(j); }
};

// As numpy's complex128.
struct Complex {
    double real, imag;
};

[[gnu::always_inline]] inline Complex operator+(Complex a, Complex b) {
    return {a.real + b.real, a.imag + b.imag};
}
[[gnu::always_inline]] inline Complex operator-(Complex a, Complex b) {
    return {a.real - b.real, a.imag - b.imag};
}
[[gnu::always_inline]] inline Complex operator*(Complex a, Complex b) {
    return {a.real * b.real - a.imag * b.imag, a.real * b.imag + a.imag * b.real};
}
[[gnu::always_inline]] inline Complex operator+(double a, Complex b) {
    return {a + b.real, b.imag};
}
[[gnu::always_inline]] inline Complex operator-(Complex a, double b) {
    return {a.real - b, a.imag};
}
[[gnu::always_inline]] inline Complex operator*(double a, Complex b) {
    return {a * b.real, a * b.imag};
}
[[gnu::always_inline]] inline Complex operator*(Complex a, double b) {
    return {a.real * b, a.imag * b};
}
[[gnu::always_inline]] inline Complex operator/(Complex a, double b) {
    return {a.real / b, a.imag / b};
}
[[gnu::always_inline]] inline void operator+=(Complex &a, Complex b) {
    a = a + b;
}
[[gnu::always_inline]] inline void operator-=(Complex &a, Complex b) {
    a = a - b;
}
[[gnu::always_inline]] inline void operator*=(Complex &a, Complex b) {
    a = a * b;
}
[[gnu::always_inline]] inline void operator*=(Complex &a, double b) {
    a = a * b;
}
[[gnu::always_inline]] inline bool operator==(Complex a, double b) {
    return a.real == b && a.imag == 0.0;
}
[[gnu::always_inline]] inline bool operator!=(Complex a, double b) {
    return !(a == b);
}
[[gnu::always_inline]] inline Complex conjugate(Complex a) {
    return {a.real, -a.imag};
}

// By the larger part of the divisor, so that no square overflows (R. L. Smith, 1962).
inline Complex operator/(Complex a, Complex b) {
    if (__builtin_fabs(b.real) >= __builtin_fabs(b.imag)) {
        double ratio = b.imag / b.real, divisor = b.real + b.imag * ratio;
        return {(a.real + a.imag * ratio) / divisor, (a.imag - a.real * ratio) / divisor};
    }
    double ratio = b.real / b.imag, divisor = b.real * ratio + b.imag;
    return {(a.real * ratio + a.imag) / divisor, (a.imag * ratio - a.real) / divisor};
}

// The first where they are equal, or where one is not a number.
[[gnu::always_inline]] inline double larger(double a, double b) {
    return b > a ? b : a;
}
[[gnu::always_inline]] inline double smaller(double a, double b) {
    return b < a ? b : a;
}
[[gnu::always_inline]] inline Index larger(Index a, Index b) {
    return b > a ? b : a;
}
[[gnu::always_inline]] inline Index smaller(Index a, Index b) {
    return b < a ? b : a;
}
[[gnu::always_inline]] inline double magnitude(double a) {
    return __builtin_fabs(a);
}
[[gnu::always_inline]] inline bool is_finite(double a) {
    return magnitude(a) < INFINITE;
}

using Array = View<double, 1>;
using Matrix = View<double, 2>;
using ComplexArray = View<Complex, 1>;
using ComplexMatrix = View<Complex, 2>;
// What a call only reads.
using GivenArray = View<const double, 1>;
using GivenMatrix = View<const double, 2>;
using GivenComplexArray = View<const Complex, 1>;
using GivenComplexMatrix = View<const Complex, 2>;
using GivenIndices = View<const Index, 1>;

} // namespace FEMIMPACT_TARGET
