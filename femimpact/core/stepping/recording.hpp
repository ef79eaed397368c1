// What the loop over steps keeps now and then: cycle statistics, samples and snapshots.
#pragma once

#include "ledger.hpp"

namespace FEMIMPACT_TARGET::stepping {

// Writes the statistics of every case whose base cycle ends at this step, and starts the next.
[[gnu::noinline]] inline void close_cycles(Index step, const Stepped &given) {
    const Motion &m = given.cases.motion;
    const Cycles &cycles = given.cases.cycles;
    Array energy = given.cases.energy_scratch;
    for (Index c = 0; c < cycles.number.size(); c++) {
        if (step != cycles.next_wrap(c))
            continue;
        const Index k = cycles.number(c), begun = Index(__builtin_ceil(double(k) * cycles.period(c)));
        if (k < cycles.values.shape[0]) {
            // the extremes are there: a cycle ends within a step
            for (Index i = MINIMUM + 1; i < CYCLE_COLUMNS; i++)
                cycles.values(k, i, c) = cycles.sums(i, c);
            cycles.values(k, SAMPLES, c) = double(step - begun);
            if (given.ledger) {
                write_energy(c, given.structure, given.cases.pairs, m, energy);
                for (Index i = 0; i < ENERGY_COLUMNS; i++)
                    cycles.energy(k + 1, i, c) = energy(i);
            }
        }
        cycles.number(c) = k + 1;
        cycles.next_wrap(c) = Index(__builtin_ceil(double(k + 2) * cycles.period(c)));
        for (Index i = MINIMUM + 1; i < CYCLE_COLUMNS; i++)
            cycles.sums(i, c) = 0.0;
        // the rotated phase is set right once a cycle, so that rounding cannot add up
        double angle = m.drive(PHASE, c) + m.drive(PHASE_STEP, c) * double(step);
        m.drive(SINE, c) = __builtin_sin(angle);
        m.drive(COSINE, c) = __builtin_cos(angle);
    }
}

// Force (N) of a pair on the structure without its centring spring; the switching spring's is all of its law.
inline double contact_force(Index j, const Pairs &pairs, const Motion &m) {
    if (pairs.kind(j) == SWITCHING_SPRING)
        return m.ball(FORCE, j, 0);
    return m.touch(SIDE, j, 0) * m.touch(NORMAL, j, 0);
}

inline void write_sample(const Stepped &given) {
    const Pairs &pairs = given.cases.pairs;
    const Motion &m = given.cases.motion;
    const Record &record = given.cases.record;
    const Index k = record.tally(SAMPLES_KEPT);
    for (Index i = 0; i < record.used.shape[0]; i++) {
        double value = 0.0;
        if (record.used(i, 0))
            for (Index d = 0; d < m.q.shape[0]; d++)
                value += record.rows(i, 0, d) * m.q(d, 0);
        if (record.used(i, 1))
            for (Index d = 0; d < m.v.shape[0]; d++)
                value += record.rows(i, 1, d) * m.v(d, 0);
        if (record.used(i, 2))
            for (Index j = 0; j < m.ball.shape[1]; j++)
                value += record.pair_rows(i, 0, j) * m.ball(Y, j, 0) + record.pair_rows(i, 1, j) * m.ball(Y_RATE, j, 0);
        if (record.used(i, 3))
            for (Index j = 0; j < m.ball.shape[1]; j++) {
                value += record.pair_rows(i, 2, j) * m.ball(FORCE, j, 0);
                value += record.pair_rows(i, 3, j) * contact_force(j, pairs, m);
            }
        record.channels(i, k) = value;
    }
    if (given.ledger) {
        Array energy = given.cases.energy_scratch;
        write_energy(0, given.structure, pairs, m, energy);
        for (Index i = 0; i < ENERGY_COLUMNS; i++)
            record.energy(i, k) = energy(i);
        for (Index i = 0; i < m.loss_of_mode.size(); i++)
            record.energy(ENERGY_COLUMNS + i, k) = m.loss_of_mode(i);
        const Index drives = m.drives.shape[0];
        for (Index i = 0; drives > 0 && i <= drives; i++)
            record.work_of(i, k) = m.work_of(i) + (i < drives ? 0.0 : work_of_constant_load(0, given.structure, m));
    }
    record.tally(SAMPLES_KEPT) = k + 1;
}

inline void write_snapshot(const Stepped &given) {
    const Motion &m = given.cases.motion;
    const Record &record = given.cases.record;
    const Index k = record.tally(SNAPSHOTS_KEPT), n = m.q.shape[0];
    for (Index i = 0; i < n; i++) {
        record.snapshots(k, 0, i) = m.q(i, 0);
        record.snapshots(k, 1, i) = m.v(i, 0);
    }
    for (Index j = 0; j < m.ball.shape[1]; j++) {
        record.snapshots(k, 0, n + j) = m.ball(Y, j, 0);
        record.snapshots(k, 1, n + j) = m.ball(Y_RATE, j, 0);
        record.forces(k, j) = contact_force(j, given.cases.pairs, m);
    }
    record.tally(SNAPSHOTS_KEPT) = k + 1;
}

// Writes the sample and the snapshot that are due at this step.
[[gnu::noinline]] inline void keep(Index step, const Stepped &given) {
    const Record &record = given.cases.record;
    GivenIndices stride = record.stride;
    const Index every = stride(0), first = stride(1), stride_of_fields = stride(2), first_field = stride(3);
    if (step >= first && (step - first) % every == 0 && record.tally(SAMPLES_KEPT) < record.channels.shape[1])
        write_sample(given);
    if (step >= first_field && (step - first_field) % stride_of_fields == 0 &&
        record.tally(SNAPSHOTS_KEPT) < record.snapshots.shape[0])
        write_snapshot(given);
}

// Whether a sample or a snapshot falls on this step.
inline bool any_due(Index step, const Record &record) {
    GivenIndices stride = record.stride;
    return (record.channels.shape[1] > 0 && (step - stride(1)) % stride(0) == 0) ||
           (record.snapshots.shape[0] > 0 && (step - stride(3)) % stride(2) == 0);
}

// Smallest of some numbers.
inline Index least(View<Index, 1> values) {
    Index smallest = values(0);
    for (Index i = 1; i < values.size(); i++)
        smallest = smaller(smallest, values(i));
    return smallest;
}

} // namespace FEMIMPACT_TARGET::stepping
