// Work and losses by Gauss points, where the entries of a motion are coupled in blocks, a stop does not move with the
// base, or several drives act on a rigid-body coordinate.
#pragma once

#include "gauss.hpp"
#include "ledger_products.hpp"

namespace FEMIMPACT_TARGET {

// A drive at a time: of its polynomial in the present piece of the case, or of its sine.
[[gnu::noinline]] inline double value_of_drive(Index k, double time, Complex phase, const Case &c, const Ledger &b) {
    if (b.drive_pieces.shape[0] == 0)
        return (b.drive_amplitude(k) * phase).imag;
    Index piece = c.piece(0);
    double later = time - c.knots(piece), total = 0.0;
    for (Index n = DRIVE - 3; n >= 0; n--)
        total = b.drive_pieces(piece, (DRIVE - 2) * k + n) * INVERSE_FACTORIAL[n] + total * later;
    return total;
}

// Adds a share of the work of each drive, and of constant forces, at an instant; velocities are those of `after`.
//
// The sum is that of their loads together, which may cancel; `load` (d,) is scratch space.
[[gnu::noinline]] inline void add_work_of_drives(double share, double time, Complex phase, Matrix after, Array load,
                                                 const Case &c, const Ledger &b) {
    Index drives = b.drive_load.shape[0];
    double power_of_all = 0.0, of_constant = 0.0;
    for (Index i = 0; i < b.mass.size(); i++)
        load(i) = 0.0;
    for (Index k = 0; k < drives; k++) {
        double acting = value_of_drive(k, time, phase, c, b), power = 0.0;
        for (Index i = 0; i < b.mass.size(); i++) {
            load(i) += b.drive_load(k, i) * acting;
            power += b.drive_load(k, i) * after(1, i);
        }
        b.work_of(c.number, k) += share * acting * power;
    }
    for (Index i = 0; i < b.mass.size(); i++) {
        power_of_all += load(i) * after(1, i);
        of_constant += b.given(i) * after(1, i);
    }
    b.work_of(c.number, drives) += share * of_constant;
    b.work(c.number) += share * (power_of_all + of_constant);
}

// Adds work and losses by Gauss points, exact to rounding; uses `after` up.
[[gnu::noinline]] inline void sum_over_points(double duration, const Form &form, const Pairs &pairs, const Case &c,
                                              const Space &space, const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Motion &scratch = space.scratch;
    Matrix after = space.products.after;
    copy_motion(space.mark, scratch);
    double start = space.mark.clock(0), elapsed = 0.0;
    while (elapsed < duration) {
        double panel = next_panel(elapsed, duration - elapsed, scalars, scratch), half = 0.5 * panel;
        for (Index node = 0; node < GAUSS_POINTS; node++) {
            double time = start + elapsed + half * (1.0 + NODES[node]), share = half * WEIGHTS[node];
            move(scalars, scratch, time - scratch.clock(0));
            read_coordinates(form.shapes, scratch, after);
            Complex phase = unit_phase(scalars.omega, scratch.clock);
            double acting = scalars.degree >= 0 ? scratch.drive(2) : c.amplitude(0).real * phase.imag;
            double base_rate = base_motion(c, scratch).rate;
            bool several = b.drive_load.shape[0] > 0;
            if (several)
                add_work_of_drives(share, time, phase, after, space.products.before.row(0), c, b);
            for (Index i = 0; i < b.mass.size(); i++) {
                double v = after(1, i);
                if (!several)
                    b.work(c.number) += share * (b.load(i) * acting + b.given(i)) * v;
                if (b.damping(i) > 0.0)
                    b.loss_of_mode(c.number, i) += share * b.damping(i) * v * v;
            }
            for (Index j = 0; j < c.state.size(); j++) {
                if (b.free_damping(j) > 0.0) {
                    double rate = gap_of(j, pairs, after.row(1), base_rate);
                    b.contact_loss(c.number) += share * b.free_damping(j) * rate * rate;
                }
                if (!is_active(c.state(j)))
                    continue;
                double force = value_now(c.state.size() + j, scalars.exponent.size(), phase, scalars, scratch);
                // what holds a stop in space does work where the stop moves against the base
                add_work_of_base(-(share * force * pairs.in_space(j) * base_rate), c, b);
                if (pairs.rigid(j))
                    continue;
                double rate = gap_of(j, pairs, after.row(1), base_rate);
                double loss = share * c.damping(j) * rate * rate;
                b.contact_loss(c.number) += loss;
                c.touch(LOST, j) += loss;
                for (Index i = 0; i < c.to_modes.shape[1]; i++)
                    c.to_modes(j, i) += share * pairs.direction(j, i) * force * after(1, i);
            }
        }
        elapsed += panel;
    }
}

} // namespace FEMIMPACT_TARGET
