// Kernels of one target: this file is compiled once for each, with FEMIMPACT_TARGET = v2, v3, v4 or arm64.
#include "kernels.hpp"

#include "contact/formulas.hpp"
#include "event_driven/loop.hpp"

#define FEMIMPACT_JOINED(a, b) a##b
#define FEMIMPACT_NAME(a, b) FEMIMPACT_JOINED(a, b)
#define FEMIMPACT_TEXT(a) #a
#define FEMIMPACT_WORD(a) FEMIMPACT_TEXT(a)

namespace FEMIMPACT_TARGET {

static constexpr femimpact_kernels KERNELS = {
    .target = FEMIMPACT_WORD(FEMIMPACT_TARGET),
    .exponentials =
        [](const double *exponent, double time, double *out, std::int64_t count) {
            auto *from = reinterpret_cast<const Complex *>(exponent);
            exponentials({from, {count}}, time, {reinterpret_cast<Complex *>(out), {count}});
        },
    .cosine_and_sine =
        [](double angle, double *cosine, double *sine) {
            auto both = cosine_and_sine(angle);
            *cosine = both.cosine;
            *sine = both.sine;
        },
    .run_cases =
        [](const void *task, const void *job, const void *ledger) {
            run_cases(*static_cast<const Task *>(task), *static_cast<const Job *>(job),
                      static_cast<const Ledger *>(ledger));
        },
    .next_event = [](const void *call, double until) -> std::int64_t {
        auto &given = *static_cast<const SearchCall *>(call);
        return next_event(given.scalars, given.motion, until, given.search);
    },
    .kelvin_voigt_force = [](double depth, double rate, double stiffness,
                             double damping) { return kelvin_voigt_force(depth, rate, stiffness, damping); },
    .spring_potential = [](double depth, double stiffness) { return spring_potential(depth, stiffness); },
};

} // namespace FEMIMPACT_TARGET

extern "C" const femimpact_kernels *FEMIMPACT_NAME(femimpact_kernels_, FEMIMPACT_TARGET)(void) {
    return &FEMIMPACT_TARGET::KERNELS;
}
