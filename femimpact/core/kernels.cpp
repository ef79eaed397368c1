// Kernels of one target: this file is compiled once for each, with FEMIMPACT_TARGET = v2, v3, v4 or arm64.
#include "kernels.hpp"

#include <cmath>

#define FEMIMPACT_JOINED(a, b) a##b
#define FEMIMPACT_NAME(a, b) FEMIMPACT_JOINED(a, b)
#define FEMIMPACT_TEXT(a) #a
#define FEMIMPACT_WORD(a) FEMIMPACT_TEXT(a)

namespace FEMIMPACT_TARGET {

static void exponentials(const double *exponent, double time, double *out, std::int64_t count) {
    for (std::int64_t k = 0; k < count; k++) {
        const double size = std::exp(exponent[2 * k] * time), angle = exponent[2 * k + 1] * time;
        out[2 * k] = size * std::cos(angle);
        out[2 * k + 1] = size * std::sin(angle);
    }
}

static constexpr femimpact_kernels KERNELS = {FEMIMPACT_WORD(FEMIMPACT_TARGET), exponentials};

} // namespace FEMIMPACT_TARGET

extern "C" const femimpact_kernels *FEMIMPACT_NAME(femimpact_kernels_, FEMIMPACT_TARGET)(void) {
    return &FEMIMPACT_TARGET::KERNELS;
}
