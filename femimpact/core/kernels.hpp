// What a target's object gives to the module: one table of functions. kernels.cpp is compiled once for each target.
#pragma once

#include <cstdint>

// how many contact formulas there are, in the order of contact/entries.hpp
#define FEMIMPACT_FORMULA_COUNT 5

struct femimpact_kernels {
    const char *target;
    // e^{lambda t} of count complex lambda, real and imaginary parts side by side
    void (*exponentials)(const double *exponent, double time, double *out, std::int64_t count);
    // cosine and sine of an angle
    void (*cosine_and_sine)(double angle, double *cosine, double *sine);
    // takes a Task, a Job and a Ledger or null: the same structs in every target, told apart by their namespace only
    void (*run_cases)(const void *task, const void *job, const void *ledger);
    // takes a SearchCall
    std::int64_t (*next_event)(const void *call, double until);
    // contact formulas: arguments, results
    void (*formulas[FEMIMPACT_FORMULA_COUNT])(const double *given, double *found);
    // each takes a stepping::Stepped; advance a stepping::Fine or null too
    void (*advance)(std::int64_t steps, const void *stepped, const void *fine);
    void (*keep_present)(const void *stepped);
    void (*write_energies)(const void *stepped);
    // takes a Law, mass, speed and start, a stepping::Scheme; gives rebound over approach speed and peak force
    void (*collide)(const void *law, const double *numbers, const void *scheme, double *found);
};

// the only names that an object of a target exports
extern "C" {
#if defined(__x86_64__)
const femimpact_kernels *femimpact_kernels_v2(void);
const femimpact_kernels *femimpact_kernels_v3(void);
const femimpact_kernels *femimpact_kernels_v4(void);
#else
const femimpact_kernels *femimpact_kernels_arm64(void);
#endif
}
