// Kernels of one target: this file is compiled once for each, with FEMIMPACT_TARGET = v2, v3, v4 or arm64.
#include "kernels.hpp"

#include "contact/formulas.hpp"
#include "event_driven/loop.hpp"
#include "stepping/collision.hpp"
#include "stepping/loop.hpp"

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
    .formulas =
        {
            [](const double *given, double *found) {
                auto at = penetration(given[0], given[1], given[2]);
                found[0] = at.depth;
                found[1] = at.side;
            },
            [](const double *given, double *found) {
                auto law = compiled_law(given[0], given[3], given[4], given[5], given[6]);
                *found = normal_force(law, given[1], given[2]);
            },
            [](const double *given, double *found) {
                *found = elastic_potential(compiled_law(given[0], given[2], 0.0, given[3], 1.0), given[1]);
            },
            [](const double *given, double *found) {
                *found = switching_stiffness(given[0], given[1], given[2], given[3], given[4]);
            },
            [](const double *given, double *found) {
                *found = switching_potential(given[0], given[1], given[2], given[3], given[4]);
            },
        },
    .advance =
        [](std::int64_t steps, const void *stepped, const void *fine) {
            stepping::advance(steps, *static_cast<const stepping::Stepped *>(stepped),
                              static_cast<const stepping::Fine *>(fine));
        },
    .keep_present =
        [](const void *stepped) {
            auto &given = *static_cast<const stepping::Stepped *>(stepped);
            stepping::keep(given.cases.record.tally(stepping::STEP), given);
        },
    .write_energies =
        [](const void *stepped) { stepping::write_energies(*static_cast<const stepping::Stepped *>(stepped)); },
    .collide =
        [](const void *law, const double *numbers, const void *scheme, double *found) {
            auto collision = stepping::collide(*static_cast<const Law *>(law), numbers[0], numbers[1], numbers[2],
                                               *static_cast<const stepping::Scheme *>(scheme));
            found[0] = collision.rebound;
            found[1] = collision.peak;
        },
};

} // namespace FEMIMPACT_TARGET

extern "C" const femimpact_kernels *FEMIMPACT_NAME(femimpact_kernels_, FEMIMPACT_TARGET)(void) {
    return &FEMIMPACT_TARGET::KERNELS;
}
