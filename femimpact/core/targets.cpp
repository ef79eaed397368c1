#include "targets.hpp"

#include <cstdio>
#include <cstring>
#include <initializer_list>

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace FEMIMPACT_TARGET {

#if defined(__x86_64__)

const Target TARGETS[] = {
    {"v2", 2, femimpact_kernels_v2},
    {"v3", 3, femimpact_kernels_v3},
    {"v4", 4, femimpact_kernels_v4},
};
const int TARGET_COUNT = 3;

namespace {

struct Registers {
    unsigned a, b, c, d;
};

// all zero where the processor has no such leaf. __builtin_cpu_supports is silently false with some compilers
Registers cpuid(unsigned leaf) {
    Registers r = {0, 0, 0, 0};
    if (!__get_cpuid_count(leaf, 0, &r.a, &r.b, &r.c, &r.d)) {
        return {0, 0, 0, 0};
    }
    return r;
}

constexpr unsigned bits(std::initializer_list<unsigned> places) {
    unsigned all = 0;
    for (unsigned place : places) {
        all |= 1U << place;
    }
    return all;
}

bool has(unsigned value, unsigned wanted) {
    return (value & wanted) == wanted;
}

// which registers the operating system keeps for a process: bits of XCR0
unsigned kept_registers() {
    unsigned low = 0, high = 0;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

} // namespace

// the lists of the x86-64 psABI, table 3.1
int processor_level() {
    const Registers one = cpuid(1), seven = cpuid(7), extended = cpuid(0x80000001);
    // cmpxchg16b, lahf, popcnt, sse3, sse4.1, sse4.2, ssse3
    if (!has(one.c, bits({0, 9, 13, 19, 20, 23})) || !has(extended.c, bits({0}))) {
        return 1;
    }
    // fma, movbe, osxsave, avx, f16c; lzcnt; bmi1, avx2, bmi2
    if (!has(one.c, bits({12, 22, 27, 28, 29})) || !has(extended.c, bits({5})) || !has(seven.b, bits({3, 5, 8}))) {
        return 2;
    }
    const unsigned kept = kept_registers();
    if (!has(kept, bits({1, 2}))) {
        return 2;
    }
    // avx512 f, dq, cd, bw, vl; opmask, upper halves, upper sixteen
    return has(seven.b, bits({16, 17, 28, 30, 31})) && has(kept, bits({5, 6, 7})) ? 4 : 3;
}

static const char TOO_OLD[] = "this processor lacks x86-64-v2 (SSE4.2 and POPCNT, as processors have from 2009 on)";

#else

const Target TARGETS[] = {{"arm64", 1, femimpact_kernels_arm64}};
const int TARGET_COUNT = 1;

int processor_level() {
    return 1;
}

static const char TOO_OLD[] = "this processor has none of the targets";

#endif

Choice choose_target(int level, const char *asked) {
    Choice choice = {nullptr, ""};
    if (level < TARGETS[0].level) {
        snprintf(choice.refusal, sizeof choice.refusal, "%s", TOO_OLD);
        return choice;
    }
    char held[32] = "";
    for (const Target *target = TARGETS; target < TARGETS + TARGET_COUNT; target++) {
        const size_t used = strlen(held);
        snprintf(held + used, sizeof held - used, "%s%s", used ? ", " : "", target->name);
        if (asked == nullptr || *asked == '\0') {
            choice.target = target->level <= level ? target : choice.target;
        } else if (strcmp(asked, target->name) == 0) {
            if (target->level > level) {
                snprintf(choice.refusal, sizeof choice.refusal,
                         "FEMIMPACT_CORE = '%s': this processor has no x86-64-%s", asked, asked);
                return choice;
            }
            choice.target = target;
        }
    }
    if (choice.target == nullptr) {
        snprintf(choice.refusal, sizeof choice.refusal, "FEMIMPACT_CORE = '%.40s': must be one of %s", asked, held);
    }
    return choice;
}

} // namespace FEMIMPACT_TARGET
