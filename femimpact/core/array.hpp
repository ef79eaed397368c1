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

// Contiguous items along N axes.
template <class T, int N> struct View {
    T *data;
    Index shape[N];

    template <class... Place>
        requires(sizeof...(Place) == N)
    [[gnu::always_inline]] T &operator()(Place... place) const {
        Index at = 0, axis = 0;
        ((check_index(place, shape[axis]), at = at * shape[axis] + place, axis++), ...);
        return data[at];
    }
    // What is at a place of the first axis, or at places of several.
    [[gnu::always_inline]] View<T, N - 1> row(Index i) const {
        check_index(i, shape[0]);
        View<T, N - 1> inner = {};
        Index items = 1;
        for (int axis = 1; axis < N; axis++)
            items *= inner.shape[axis - 1] = shape[axis];
        inner.data = data + i * items;
        return inner;
    }
    [[gnu::always_inline]] auto row(Index i, Index j) const { return row(i).row(j); }
    [[gnu::always_inline]] Index size() const { return shape[0]; }
    // The items of a row from `from` to before `to`.
    [[gnu::always_inline]] View part(Index from, Index to) const { return {data + from, {to - from}}; }
    [[gnu::always_inline]] View first(Index count) const { return part(0, count); }
    // The same items, only to be read.
    [[gnu::always_inline]] operator View<const T, N>() const
        requires(!__is_same(const T, T))
    {
        View<const T, N> same = {};
        same.data = data;
        for (int axis = 0; axis < N; axis++)
            same.shape[axis] = shape[axis];
        return same;
    }
};
template <class T> struct View<T, 0> {
    T *data;
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
[[gnu::always_inline]] inline void operator*=(Complex &a, auto b) {
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
template <class Number> [[gnu::always_inline]] inline Number larger(Number a, Number b) {
    return b > a ? b : a;
}
template <class Number> [[gnu::always_inline]] inline Number smaller(Number a, Number b) {
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
