// What a target's object gives to the module: one table of functions. kernels.cpp is compiled once for each target.
#pragma once

#include <cstdint>

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
    double (*kelvin_voigt_force)(double depth, double rate, double stiffness, double damping);
    double (*spring_potential)(double depth, double stiffness);
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
