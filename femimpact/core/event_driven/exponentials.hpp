// Exponentials of many complex numbers at once, by arithmetic alone: several at a time in one register.
//
// What is computed here is within two units in the last place, and the same on every processor and from every compiler.
// Angles are reduced by multiples of pi/2 in three parts (Cody and Waite, 1980); the polynomials of sine and cosine are
// those of k_sin.c and k_cos.c in Sun Microsystems' fdlibm. That of e^x, reduced by multiples of ln 2, is Taylor's.
#pragma once

#include "../array.hpp"
#include "../pack.hpp"

namespace FEMIMPACT_TARGET {

// rad up to which multiples of the first part of pi/2 are exact; beyond it the C library takes over.
constexpr double LARGEST_ANGLE = 1e6;

// Negative exponent up to which e^x is no denormal number.
constexpr double LARGEST_DECAY = 700.0;

// 3 . 2^51: added and taken off again it rounds to the nearest integer.
constexpr double ROUND = 6755399441055744.0;

// pi/2 in parts, the first two of 33 bits.
constexpr double TWO_OVER_PI = 0.6366197723675814;
constexpr double PI_1 = 1.5707963267341256, PI_2 = 6.077100506303966e-11, PI_3 = 2.0222662487959506e-21;

// ln 2 in parts, the first of 33 bits.
constexpr double ONE_OVER_LN_2 = 1.4426950408889634;
constexpr double LN_1 = 0.6931471803691238, LN_2 = 1.9082149292705877e-10;

template <class Value> struct CosineAndSine {
    Value cosine, sine;
};

template <class Value> [[gnu::always_inline]] inline CosineAndSine<Value> reduced_cosine_and_sine(Value angle) {
    Value n = (angle * TWO_OVER_PI + ROUND) - ROUND;
    Value r = ((angle - n * PI_1) - n * PI_2) - n * PI_3;
    Value z = r * r;
    Value z2 = z * z;
    Value s = -1.66666666666666324348e-01 + z * 8.33333333332248946124e-03;
    s += z2 * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06);
    s += z2 * z2 * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    Value c = 4.16666666666666019037e-02 + z * -1.38888888888741095749e-03;
    c += z2 * (2.48015872894767294178e-05 + z * -2.75573143513906633035e-07);
    c += z2 * z2 * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11);
    s = r + r * z * s;
    c = 1.0 - (0.5 * z - z2 * c);
    // quarter turns, from -2 to 2
    Value q = n - 4.0 * ((n * 0.25 + ROUND) - ROUND);
    auto turned = q * q == 1.0;
    Value sine = turned ? c : s, cosine = turned ? s : c;
    return {((q == 0.0) | (q == -1.0)) ? cosine : -cosine, ((q == 0.0) | (q == 1.0)) ? sine : -sine};
}

// Both of an angle (rad).
[[gnu::always_inline]] inline CosineAndSine<double> cosine_and_sine(double angle) {
    if (magnitude(angle) < LARGEST_ANGLE)
        return reduced_cosine_and_sine(angle);
    return {__builtin_cos(angle), __builtin_sin(angle)};
}

template <class Value> [[gnu::always_inline]] inline Value reduced_exponential(Value x) {
    Value moved = x * ONE_OVER_LN_2 + ROUND;
    Value n = moved - ROUND;
    Value r = (x - n * LN_1) - n * LN_2;
    Value r2 = r * r;
    Value r4 = r2 * r2;
    Value p = (1 / 6.0 + r * (1 / 24.0)) + r2 * (1 / 120.0 + r * (1 / 720.0));
    p += r4 * ((1 / 5040.0 + r * (1 / 40320.0)) + r2 * (1 / 362880.0 + r * (1 / 3628800.0)));
    p += r4 * r4 * ((1 / 39916800.0 + r * (1 / 479001600.0)) + r2 * (1 / 6227020800.0));
    // n stands in the last places of what was rounded: shifted to where a number's power of two stands
    Value power = with_bits((bits_of(moved) << 52) + (1023ULL << 52), x);
    return (1.0 + (r + r2 * (0.5 + r * p))) * power;
}

// Sets W of the exponentials; whether any of them is beyond what arithmetic alone gives.
template <int W>
[[gnu::always_inline]] inline bool set_exponentials(const Complex *exponent, double time, Complex *out) {
    auto lambda = load_parts<W>(exponent);
    auto x = lambda.real * time, angle = lambda.imag * time;
    auto turn = reduced_cosine_and_sine(angle);
    auto size = reduced_exponential(x);
    store_parts(Parts<W>{size * turn.cosine, size * turn.sine}, out);
    auto beyond = (angle > LARGEST_ANGLE) | (angle < -LARGEST_ANGLE) | (x < -LARGEST_DECAY);
    Index any = 0;
    for (int i = 0; i < W; i++)
        any |= beyond[i];
    return any != 0;
}

template <> [[gnu::always_inline]] inline bool set_exponentials<1>(const Complex *exponent, double time, Complex *out) {
    double x = exponent->real * time, angle = exponent->imag * time;
    auto turn = reduced_cosine_and_sine(angle);
    double size = reduced_exponential(x);
    *out = {size * turn.cosine, size * turn.sine};
    return magnitude(angle) > LARGEST_ANGLE || x < -LARGEST_DECAY;
}

// Sets e^{lambda t} of several lambda with Re lambda <= 0.
[[gnu::noinline]] inline void exponentials(GivenComplexArray exponent, double time, ComplexArray out) {
    Index count = exponent.size(), k = 0;
    bool beyond = false;
    for (; k + LANES <= count; k += LANES)
        beyond |= set_exponentials<LANES>(exponent.data + k, time, out.data + k);
    if constexpr (LANES > 4)
        if (k + 4 <= count) {
            beyond |= set_exponentials<4>(exponent.data + k, time, out.data + k);
            k += 4;
        }
    if constexpr (LANES > 2)
        if (k + 2 <= count) {
            beyond |= set_exponentials<2>(exponent.data + k, time, out.data + k);
            k += 2;
        }
    for (; k < count; k++)
        beyond |= set_exponentials<1>(exponent.data + k, time, out.data + k);
    if (!beyond)
        return;
    for (k = 0; k < count; k++) {
        double x = exponent(k).real * time, angle = exponent(k).imag * time;
        if (magnitude(angle) > LARGEST_ANGLE || x < -LARGEST_DECAY) {
            double size = __builtin_exp(x);
            out(k) = {size * __builtin_cos(angle), size * __builtin_sin(angle)};
        }
    }
}

} // namespace FEMIMPACT_TARGET
