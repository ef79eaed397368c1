// The loop over events, case by case: the next event, readings, ledger, transition.
#pragma once

#include "reading.hpp"
#include "transition.hpp"

namespace FEMIMPACT_TARGET {

// s, for which a search looks ahead where slow motions are: these may grow meanwhile.
constexpr double LONGEST_OF_SLOW = 0.5;

// Events at one instant beyond which the motion is called unresolved.
constexpr Index EVENTS_AT_ONCE = 200;

// Takes the coordinates of a case into the closed form of its contact states.
[[gnu::noinline]] inline Index enter(const Case &c, const Job &job, const Ledger *b) {
    const Cases &cases = job.cases;
    const Space &space = job.space;
    const Motion &motion = space.motion;
    Index &entering = cases.entering(c.number);
    if (entering == STARTING) {
        set_start_states(job.pairs, c, motion);
        entering = STARTED;
    }
    Index f = find_form(c.state, cases.form(c.number, 0), job.forms);
    if (f < 0)
        return FORM_WANTED;
    Index n = job.forms.number(f);
    if (!cases.known(c.number, n)) {
        if (c.omega != 0.0 && !set_steady_motion(f, c, job.forms, space.bounds.steady))
            return RESONANT;
        cases.known(c.number, n) = 1;
    }
    cases.form(c.number, 1) = f;
    set_walls(f, c, job.forms, space.bounds);
    Form form = form_of(f, c, job.forms, space.bounds);
    if (b && entering >= STARTED)
        write_energy(job.pairs, c, motion, c.coordinates, *b, b->start.row(c.number));
    if (entering != RESUMED)
        enter_form(f, form.shapes, job.forms, c.coordinates, motion);
    entering = ENTERED;
    return DONE;
}

// Reads the motion at every grid time after a sample up to an instant; it is left at the last of them.
//
// What falls on an event is read after it.
[[gnu::noinline]] inline void read_samples(Index begin, double until, bool event, const Form &form, const Case &c,
                                           const Job &job, const Ledger *b) {
    const Grid &grid = job.grid;
    const Snapshots &snapshots = job.snapshots;
    const Scalars &scalars = form.scalars;
    const Motion &motion = job.space.motion;
    ComplexArray growth = job.space.turn;
    double dt = grid.interval(c.number), observed = 0.0;
    Index read = 0, active = 0, events = scalars.lasting.size(), measured = grid.cycles.shape[1];
    Complex phase = {1.0, 0.0}, wave = {1.0, 0.0};
    bool alone = !has_blocks(scalars);
    while (true) {
        Index sample = job.cases.sample(c.number) + 1, i = sample - begin - 1;
        double time = grid.start(c.number) + double(sample) * dt;
        if (time > until || (event && time == until))
            break;
        if (read > 0 && alone) {
            if (read == 1) {
                exponentials(scalars.exponent, dt, growth);
                auto [cosine, sine] = cosine_and_sine(scalars.omega * dt);
                wave = {cosine, sine};
            }
            for (Index k = 0; k < active; k++)
                motion.entry(k) *= growth(k);
            if (scalars.driven > 0)
                drive_entries(scalars, motion, time - motion.clock(0));
            move_rigid_bodies(scalars, motion, time - motion.clock(0));
            phase *= wave;
        } else {
            move(scalars, motion, time - motion.clock(0));
            motion.clock(0) = time;
            phase = unit_phase(scalars.omega, motion.clock);
            for (Index k = 0; k < scalars.exponent.size(); k++)
                if (motion.entry(k) != 0.0 || k < scalars.driven)
                    active = k + 1;
        }
        motion.clock(0) = time;
        read++;
        for (Index o = 0; o < grid.values.shape[2]; o++) {
            double value = value_now(events + o, active, phase, scalars, motion);
            if (o == 0)
                observed = value;
            if (i < grid.values.shape[1])
                grid.values(c.number, i, o) = value;
        }
        if (b && grid.energy.shape[1] > 0 && grid.kept(i) >= 0) {
            add_to_ledger(form, job.pairs, c, job.space, *b);
            Array row = grid.energy.row(c.number, grid.kept(i));
            write_energy(job.pairs, c, motion, job.space.products.after, *b, row);
            for (Index i = 0; grid.work_of.shape[1] > 0 && i < grid.work_of.shape[2]; i++)
                grid.work_of(c.number, grid.kept(sample - begin - 1), i) = b->work_of(c.number, i);
        }
        if (snapshots.shown.size() > 0 && snapshots.shown(i) >= 0)
            keep_snapshot(snapshots.shown(i), form.shapes, job.pairs, c, job.space, snapshots);
        job.cases.sample(c.number) = sample;
        if (sample > grid.origin(c.number) && grid.cycle(c.number) < measured) {
            if (cycle_end(c.number, grid) < time)
                end_cycle(c.number, cycle_end(c.number, grid), sample - 1, scalars, job.space, grid);
            if (grid.cycle(c.number) < measured) {
                add_to_cycle(sample, time, observed, phase, c.number, job.space, grid);
                if (cycle_end(c.number, grid) == time) {
                    add_peaks(c.number, time, observed, sample, scalars, job.space, grid);
                    grid.cycle(c.number) += 1;
                }
            }
        }
    }
}

// Takes a case to its next event, reading all before it; STUCK and END as in the search.
inline Index to_next_event(Index begin, double until, const Form &form, const Case &c, const Job &job,
                           const Ledger *b) {
    const Cases &cases = job.cases;
    const Space &space = job.space;
    const Scalars &scalars = form.scalars;
    const Motion &motion = space.motion, &trial = space.trial;
    Index next = cases.piece(c.number) + 1;
    double knot = scalars.degree >= 0 && next < cases.knots.size() ? cases.knots(next) : INFINITE;
    // within a long piece as far as series of driven entries serve
    double end = smaller(until, knot);
    if (are_pushed(scalars, motion.drive))
        end = smaller(end, motion.clock(0) + cases.longest);
    if (scalars.slow > 0)
        end = smaller(end, motion.clock(0) + LONGEST_OF_SLOW);
    copy_motion(motion, space.mark);
    copy_motion(motion, trial);
    Index status = next_event(scalars, trial, end, space.search);
    double reached = trial.clock(0);
    if (reached > motion.clock(0)) {
        cases.events(c.number, 1) = 0;
        for (Index j = 0; j < c.state.size(); j++)
            if (is_active(c.state(j)))
                add_contact(j, reached, job.grid.interval(c.number), scalars, c, space);
    }
    copy_motion(motion, space.begin);
    read_samples(begin, reached, status != END, form, c, job, b);
    // the samples first: where they exclude a peak none is looked for
    const Grid &grid = job.grid;
    if (grid.cycle(c.number) < grid.cycles.shape[1] && cycle_end(c.number, grid) < reached)
        end_cycle(c.number, cycle_end(c.number, grid), cases.sample(c.number), scalars, space, grid);
    if (grid.cycle(c.number) < grid.cycles.shape[1]) {
        Complex phase = unit_phase(scalars.omega, trial.clock);
        double last = value_now(scalars.lasting.size(), scalars.exponent.size(), phase, scalars, trial);
        add_peaks(c.number, reached, last, cases.sample(c.number), scalars, space, grid);
    }
    copy_motion(trial, motion);
    if (b && (b->everywhere || any_compliant(c, job.pairs)))
        add_to_ledger(form, job.pairs, c, space, *b);
    if (status == END && reached >= knot) {
        begin_piece(next, cases.form(c.number, 1), cases, job.forms, motion);
        cases.piece(c.number) = next;
    }
    return status;
}

// Takes one case to a time, or to where it stops.
inline Index run_case(Index begin, double until, double most, const Case &c, const Job &job, const Ledger *b) {
    const Cases &cases = job.cases;
    const Space &space = job.space;
    const Search &search = space.search;
    search.negligible(0) = negligible_approach(job.pairs.closure, c.omega);
    bool walls = true;
    while (true) {
        if (cases.entering(c.number) != ENTERED) {
            Index status = enter(c, job, b);
            if (status != DONE)
                return status;
            walls = false;
        }
        Index f = cases.form(c.number, 1);
        if (walls)
            set_walls(f, c, job.forms, space.bounds);
        set_bounds(job.pairs, c, space.bounds);
        Form form = form_of(f, c, job.forms, space.bounds);
        walls = false;
        double hit = cases.hit(c.number), side = hit > 0.0 ? 1.0 : -1.0, before = FREE;
        Index effect = STAY, pair = Index(magnitude(hit)) - 1, impacts = job.tables.number(0);
        if (hit == 0.0) {
            Index status = to_next_event(begin, until, form, c, job, b);
            if (status == END) {
                if (space.motion.clock(0) >= until)
                    return DONE;
                continue;
            }
            Index &events = cases.events(c.number, 0), &at_once = cases.events(c.number, 1);
            events++;
            at_once++;
            if (status == STUCK || at_once > EVENTS_AT_ONCE || double(events) > most)
                return UNENDING;
            pair = Index(search.event(0)) % c.state.size();
            side = search.event(1);
            before = c.state(pair);
            effect = apply_event(status, job.pairs, c, space, job.tables);
            if (effect == COLLIDE)
                hit = side * double(pair + 1);
        }
        if (hit != 0.0)
            effect = collide(pair, side, form, job.pairs, c, space, job.tables, b);
        cases.hit(c.number) = effect == LET_GO ? hit : 0.0;
        if (effect == UNRESOLVED) {
            // for the words of the refusal
            for (Index r = 0; r < c.state.size(); r++)
                c.released(r) = space.impulse(r) != 0.0 ? search.at_wall(r) : 0.0;
            return UNENDING;
        }
        if (effect != LET_GO && job.tables.events.shape[1] > 0) {
            impacts = job.tables.number(0) - impacts;
            write_event(pair, side, before, impacts, form, job.pairs, c, space, job.tables);
        }
        if (effect == STAY)
            walls = true;
        else {
            read_coordinates(form.shapes, space.motion, c.coordinates);
            cases.entering(c.number) = ENTERING;
        }
    }
}

// The motion of a case, where it lies between calls.
[[gnu::always_inline]] inline Motion motion_of(Index c, const Cases &cases) {
    return {cases.entry.row(c), cases.rigid_body.row(c, 0), cases.rigid_body.row(c, 1), cases.clock.row(c),
            cases.drive.row(c)};
}

// Takes some cases from where they are to their sample `end`, reading those after `begin`.
inline void run_cases(const Task &task, const Job &job, const Ledger *b) {
    const Cases &cases = job.cases;
    const Space &space = job.space;
    Array leaving = space.search.leaving;
    for (Index i = 0; i < task.members.size(); i++) {
        Index c = task.members(i);
        Motion kept = motion_of(c, cases);
        Case present = {cases, c};
        copy_motion(kept, space.motion);
        copy<double>(cases.leaving.row(c), leaving);
        // nothing is read before
        cases.sample(c) = larger(cases.sample(c), task.begin(c));
        double until = job.grid.start(c) + double(task.end(c)) * job.grid.interval(c);
        task.stopped(c) = run_case(task.begin(c), until, task.most(c), present, job, b);
        copy_motion(space.motion, kept);
        copy<double>(leaving, cases.leaving.row(c));
    }
}

} // namespace FEMIMPACT_TARGET
