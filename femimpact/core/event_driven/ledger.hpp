// The energy ledger between events, by one of three integrations.
#pragma once

#include "../contact/formulas.hpp"
#include "ledger_points.hpp"
#include "ledger_polynomials.hpp"

namespace FEMIMPACT_TARGET {

// Rounding of a displacement as a share of the terms that make it.
constexpr double PLACES = 16.0 * 2.220446049250313e-16;

// Whether a compliant contact has begun and not ended.
[[gnu::always_inline]] inline bool any_compliant(const Case &c, const Pairs &pairs) {
    bool found = false;
    for (Index j = 0; j < c.state.size(); j++)
        found = found || (c.state(j) != FREE && !pairs.rigid(j));
    return found;
}

// What its drive does on a rigid-body coordinate of unit mass: all that its kinetic energy gains.
//
// The work of constant forces is in that of the coordinates already.
[[gnu::always_inline]] inline double work_on_rigid_body(Index p, const Form &form, const Motion &mark,
                                                        const Motion &motion) {
    const Scalars &scalars = form.scalars;
    double before = mark.rigid_body_rate(p), after = motion.rigid_body_rate(p);
    double increment = motion.rigid_body(p) - mark.rigid_body(p);
    if (scalars.degree < 0) {
        Complex turned = form.rigid_body_sine(p);
        Complex was = turned * unit_phase(scalars.omega, mark.clock);
        Complex now = turned * unit_phase(scalars.omega, motion.clock);
        before -= scalars.omega * was.imag;
        after -= scalars.omega * now.imag;
        increment += now.real - was.real;
    }
    return 0.5 * (after * after - before * before) - form.load_on_rigid_body(p, 0) * increment;
}

// Energy in a compliant wall.
[[gnu::noinline]] inline double stored_in_wall(Index j, const Pairs &pairs, const Case &c, GivenArray position,
                                               double base) {
    double x = gap_of(j, pairs, position, base), side = side_of(c.state(j));
    return spring_potential(larger(side * x - gap_on(side, j, c), 0.0), c.stiffness(j));
}

// Loss of walls that spring back without force behind what leaves them.
[[gnu::always_inline]] inline double add_separating(const Pairs &pairs, const Case &c, const Space &space) {
    const Products &s = space.products;
    double loss = 0.0, was = base_motion(c, space.mark).position, base = base_motion(c, space.motion).position;
    for (Index j = 0; j < c.state.size(); j++)
        if (magnitude(c.state(j)) == SEPARATING) {
            double lost =
                stored_in_wall(j, pairs, c, s.before.row(0), was) - stored_in_wall(j, pairs, c, s.after.row(0), base);
            loss += lost;
            c.touch(LOST, j) += lost;
        }
    return loss;
}

// Bound on what rounding makes of the energies of contacts.
//
// x = y - w is known to some units in the last place of y, w and the gap, and so the contact's energy to its largest
// force times that.
[[gnu::always_inline]] inline double rounding_of_contacts(const Pairs &pairs, const Case &c, const Matrix &state) {
    double total = 0.0;
    for (Index j = 0; j < c.state.size(); j++)
        if (c.state(j) != FREE && !pairs.rigid(j)) {
            double size = magnitude(gap_on(c.state(j), j, c));
            for (Index i = 0; i < state.shape[1]; i++)
                size += magnitude(pairs.direction(j, i) * state(0, i));
            total += PLACES * size * c.touch(LARGEST_FORCE, j);
        }
    return total;
}

// Whether the work of several drives needs points: of lines, and of forces on rigid-body coordinates.
[[gnu::noinline]] inline bool needs_points(const Form &form, const Ledger &b) {
    const Shapes &shapes = form.shapes;
    bool found = b.drive_load.shape[0] > 0 && (form.scalars.degree == 0 || form.scalars.degree == 1);
    for (Index k = 1; k < b.drive_load.shape[0]; k++)
        for (Index i = 0; i < b.mass.size(); i++)
            for (Index p = 0; p < shapes.rigid_bodies; p++)
                found = found || (b.drive_load(k, i) != 0.0 && shapes.rigid_body_shape(i, p) != 0.0);
    return found;
}

// Adds work, losses, and what contacts give to modes, from the mark to the present motion; sets the mark there.
[[gnu::noinline]] inline void add_to_ledger(const Form &form, const Pairs &pairs, const Case &c, const Space &space,
                                            const Ledger &b) {
    const Scalars &scalars = form.scalars;
    const Products &s = space.products;
    const Motion &mark = space.mark, &motion = space.motion;
    if (scalars.driven > 0 && !are_pushed(scalars, mark.drive)) {
        // after the end of a drive steps are long: exponentials alone, where a series would diverge
        Form undriven = form;
        undriven.scalars.driven = 0;
        add_to_ledger(undriven, pairs, c, space, b);
        return;
    }
    double duration = motion.clock(0) - mark.clock(0);
    bool active = false, moving = false, braked = false;
    for (Index j = 0; j < c.state.size(); j++) {
        active = active || is_active(c.state(j));
        moving = moving || (is_active(c.state(j)) && pairs.in_space(j) != 0.0);
        braked = braked || b.free_damping(j) > 0.0;
    }
    bool compliant = any_compliant(c, pairs);
    read_coordinates(form.shapes, motion, s.after);
    if (duration > 0.0) {
        read_coordinates(form.shapes, mark, s.before);
        if (compliant)
            b.contact_loss(c.number) += add_separating(pairs, c, space);
        if (needs_points(form, b) || has_blocks(scalars) || scalars.slow > 0 || moving ||
            (scalars.degree >= 0 && (active || braked)) || are_mixed(form.shapes, scalars.driven, b.mass.size())) {
            sum_over_points(duration, form, pairs, c, space, b);
            read_coordinates(form.shapes, motion, s.after);
        } else {
            bool polynomial = scalars.degree > 1;
            Index terms = scalars.exponent.size() + (polynomial ? 0 : scalars.degree >= 0 ? 2 : 1);
            integrate_terms(scalars, form.together, duration, terms, s);
            set_strengths(terms, form, b.mass.size(), space);
            if (b.everywhere) {
                if (polynomial)
                    sum_polynomials(terms, duration, form, c, space, b);
                else
                    sum_products(terms, duration, form, c, space, b);
                for (Index p = 0; p < form.shapes.rigid_bodies; p++)
                    add_work_of_base(work_on_rigid_body(p, form, mark, motion), c, b);
                for (Index j = 0; j < c.state.size(); j++)
                    if (b.free_damping(j) > 0.0)
                        b.contact_loss(c.number) += b.free_damping(j) * square_of_rate(j, terms, pairs, s);
            }
            for (Index j = 0; j < c.state.size(); j++)
                if (is_active(c.state(j)) && !pairs.rigid(j)) {
                    double loss = add_contact_work(j, terms, scalars, pairs, c, space);
                    b.contact_loss(c.number) += loss;
                    c.touch(LOST, j) += loss;
                }
        }
        if (compliant)
            b.rounding(c.number) += rounding_of_contacts(pairs, c, s.after);
    }
    copy_motion(motion, mark);
}

// Sets `out` to the energies of the coordinates given (kinetic, strain, of balls, of contacts, work, losses of the
// structure and of contacts), then the loss of every mode.
[[gnu::noinline]] inline void write_energy(const Pairs &pairs, const Case &c, const Motion &motion, const Matrix &state,
                                           const Ledger &b, Array out) {
    Index n = b.loss_of_mode.shape[1];
    double base = base_motion(c, motion).position;
    out(ENERGY_KINETIC) = out(ENERGY_STRAIN) = out(ENERGY_BALL) = out(ENERGY_CONTACT) = out(ENERGY_STRUCTURE_LOSS) =
        0.0;
    for (Index i = 0; i < b.mass.size(); i++) {
        double kinetic = 0.5 * b.mass(i) * (state(1, i) * state(1, i));
        if (i < n) {
            out(ENERGY_KINETIC) += kinetic;
            out(ENERGY_STRAIN) += 0.5 * b.stiffness(i) * (state(0, i) * state(0, i));
            out(ENERGY_STRUCTURE_LOSS) += b.loss_of_mode(c.number, i);
            out(ENERGY_COLUMNS + i) = b.loss_of_mode(c.number, i);
        } else
            out(ENERGY_BALL) += kinetic;
    }
    for (Index j = 0; j < c.state.size(); j++) {
        out(ENERGY_CONTACT) += spring_potential(gap_of(j, pairs, state.row(0), base), b.free_stiffness(j));
        if (c.state(j) != FREE && !pairs.rigid(j))
            out(ENERGY_CONTACT) += stored_in_wall(j, pairs, c, state.row(0), base);
    }
    out(ENERGY_WORK) = b.work(c.number);
    out(ENERGY_CONTACT_LOSS) = b.contact_loss(c.number);
}

} // namespace FEMIMPACT_TARGET
