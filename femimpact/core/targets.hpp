// Targets: for which processors the kernels are compiled, and which of them a process takes.
#pragma once

#include "kernels.hpp"

namespace FEMIMPACT_TARGET {

struct Target {
    const char *name;
    // as processor_level counts
    int level;
    const femimpact_kernels *(*kernels)(void);
};

struct Choice {
    // null where none fits
    const Target *target;
    // why, in one line
    char refusal[200];
};

// every target that this binary holds, the lowest first
extern const Target TARGETS[];
extern const int TARGET_COUNT;

// the highest x86-64-vN that processor and operating system have, 1 where they have not even v2; 1 on arm64
int processor_level();

// the highest target that a processor has, or the one that is asked for by its name; null or "" asks for none
Choice choose_target(int level, const char *asked);

} // namespace FEMIMPACT_TARGET
