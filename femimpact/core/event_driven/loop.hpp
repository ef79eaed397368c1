// The loop over events, case by case: the next event, readings, ledger, transition.
#pragma once

#include "reading.hpp"
#include "transition.hpp"

namespace FEMIMPACT_TARGET {

// s, for which a search looks ahead where slow motions are: these may grow meanwhile.
constexpr double LONGEST_OF_SLOW = 0.5;

// Events at one instant beyond which the motion is called unresolved.
constexpr Index EVENTS_AT_ONCE = 200;

// Those of a closed form by which a search looks ahead, from sample to sample, and by parts of that.
struct AllSteps {
    Steps search, reading, parts;
};

// Forms of which these are kept.
constexpr Index FORMS_AT_HAND = 4;

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

// Samples that are read together: their times (s), w, and cos and sin of the drive.
struct Samples {
    Index first, count;
    double time[WIDTH], observed[WIDTH], cosine[WIDTH], sine[WIDTH];
};

// Adds samples to the statistics of the cycles that they belong to.
[[gnu::always_inline]] inline void add_to_cycles(const Samples &read, const Scalars &scalars, const Case &c,
                                                 const Job &job, const Steps *parts) {
    const Grid &grid = job.grid;
    const Index measured = grid.cycles.shape[1];
    Index n = smaller(larger(grid.origin(c.number) + 1 - read.first, Index(0)), read.count);
    while (n < read.count && grid.cycle(c.number) < measured) {
        const double end = cycle_end(c.number, grid);
        if (end < read.time[n]) {
            end_cycle(c.number, end, read.first + n - 1, scalars, job.space, grid, parts);
            continue;
        }
        const Index number = grid.cycle(c.number), from = Index(__builtin_floor(cycle_begin(number, c.number, grid)));
        Array row = grid.cycles.row(c.number, number);
        double square = row(2), of_sine = row(3), of_cosine = row(4), samples = row(5);
        for (; n < read.count && read.time[n] <= end; n++) {
            const double w = read.observed[n];
            job.space.samples(read.first + n - from - 1) = w;
            include(w, read.time[n], row);
            square += w * w;
            of_sine += w * read.sine[n];
            of_cosine += w * read.cosine[n];
            samples += 1.0;
        }
        row(2) = square;
        row(3) = of_sine;
        row(4) = of_cosine;
        row(5) = samples;
        if (read.time[n - 1] == end) {
            add_peaks(c.number, end, read.observed[n - 1], read.first + n - 1, scalars, job.space, grid, parts);
            grid.cycle(c.number) += 1;
        }
    }
}

// Keeps energies and a snapshot of the motion at sample i of a call, where they are wanted; `go` takes it there.
template <class Go>
[[gnu::always_inline]] inline void keep_sample(Index i, Go go, const Form &form, const Case &c, const Job &job,
                                               const Ledger *b) {
    const Grid &grid = job.grid;
    const Snapshots &snapshots = job.snapshots;
    const bool energies = b && grid.energy.shape[1] > 0 && grid.kept(i) >= 0;
    const bool shown = snapshots.shown.size() > 0 && snapshots.shown(i) >= 0;
    if (energies || shown)
        go();
    if (energies) {
        add_to_ledger(form, job.pairs, c, job.space, *b);
        Array row = grid.energy.row(c.number, grid.kept(i));
        read_coordinates(form.shapes, job.space.motion, job.space.products.after);
        write_energy(job.pairs, c, job.space.motion, job.space.products.after, *b, row);
        for (Index d = 0; grid.work_of.shape[1] > 0 && d < grid.work_of.shape[2]; d++)
            grid.work_of(c.number, grid.kept(i), d) = b->work_of(c.number, d);
    }
    if (shown)
        keep_snapshot(snapshots.shown(i), form.shapes, job.pairs, c, job.space, snapshots);
}

// Reads the motion at every grid time after a sample up to an instant.
//
// What falls on an event is read after it. Where a motion can be looked at ahead, eight samples are read at a time.
[[gnu::noinline]] inline void read_samples(Index begin, double until, bool event, const Form &form, const Case &c,
                                           const Job &job, const Ledger *b, AllSteps &all_steps) {
    const Grid &grid = job.grid;
    const Scalars &scalars = form.scalars;
    const Motion &motion = job.space.motion, &anchor = job.space.anchor;
    Steps &steps = all_steps.reading;
    ComplexArray growth = job.space.turn;
    const double start = grid.start(c.number), dt = grid.interval(c.number);
    const Index events = scalars.lasting.size(), outputs = grid.values.shape[2];
    const bool ahead = may_step(scalars), alone = !has_blocks(scalars);
    const bool kept = grid.energy.shape[1] > 0 || job.snapshots.shown.size() > 0;
    Index active = 0;
    Samples read;
    read.first = job.cases.sample(c.number) + 1;
    for (bool first = true;; first = false) {
        read.count = 0;
        for (Index most = ahead ? WIDTH : 1; read.count < most; read.count++) {
            double time = start + double(read.first + read.count) * dt;
            if (time > until || (event && time == until))
                break;
            read.time[read.count] = time;
        }
        if (read.count == 0)
            break;
        if (first || (!ahead && !alone)) {
            move(scalars, motion, read.time[0] - motion.clock(0));
            for (Index k = 0; k < scalars.exponent.size(); k++)
                if (motion.entry(k) != 0.0 || k < scalars.driven)
                    active = k + 1;
            if (ahead) {
                set_steps(form.number, dt, scalars, steps);
                copy_motion(motion, anchor);
            } else if (alone)
                exponentials(scalars.exponent, dt, growth);
        } else if (ahead)
            take_steps(WIDTH, scalars, anchor, steps);
        else {
            for (Index k = 0; k < active; k++)
                motion.entry(k) *= growth(k);
            if (scalars.driven > 0)
                drive_entries(scalars, motion, read.time[0] - motion.clock(0));
            move_rigid_bodies(scalars, motion, read.time[0] - motion.clock(0));
        }
        motion.clock(0) = anchor.clock(0) = read.time[0];
        const bool measured = read.first + read.count > grid.origin(c.number) + 1;
        const Complex phase = unit_phase(scalars.omega, motion.clock);
        if (ahead) {
            store(steps.turn.times(phase), {read.cosine, {WIDTH}}, 0);
            store(steps.turn.times({phase.imag, -phase.real}), {read.sine, {WIDTH}}, 0);
        } else {
            read.cosine[0] = phase.real;
            read.sine[0] = phase.imag;
        }
        // the first output last, which stays
        for (Index o = measured || grid.values.shape[1] > 0 ? outputs - 1 : -1; o >= 0; o--) {
            if (ahead)
                store(values_ahead(events + o, active, phase, scalars, anchor, steps), {read.observed, {WIDTH}}, 0);
            else
                read.observed[0] = value_now(events + o, active, phase, scalars, motion);
            for (Index n = 0, i = read.first - begin - 1; n < read.count && i + n < grid.values.shape[1]; n++)
                grid.values(c.number, i + n, o) = read.observed[n];
        }
        for (Index n = 0; kept && n < read.count; n++) {
            auto go = [&] {
                if (!ahead)
                    return;
                copy_motion(anchor, motion);
                take_steps(n, scalars, motion, steps);
                motion.clock(0) = read.time[n];
            };
            keep_sample(read.first + n - begin - 1, go, form, c, job, b);
        }
        add_to_cycles(read, scalars, c, job, ahead ? &all_steps.parts : nullptr);
        read.first += read.count;
        job.cases.sample(c.number) = read.first - 1;
    }
}

// Takes a case to its next event, reading all before it; STUCK and END as in the search.
inline Index to_next_event(Index begin, double until, const Form &form, const Case &c, const Job &job, const Ledger *b,
                           AllSteps &steps) {
    const Cases &cases = job.cases;
    const Space &space = job.space;
    const Scalars &scalars = form.scalars;
    const Motion &motion = space.motion, &trial = space.trial;
    const Grid &grid = job.grid;
    Index next = cases.piece(c.number) + 1;
    double knot = scalars.degree >= 0 && next < cases.knots.size() ? cases.knots(next) : INFINITE;
    // within a long piece as far as series of driven entries serve
    double end = smaller(until, knot);
    if (are_pushed(scalars, motion.drive))
        end = smaller(end, motion.clock(0) + cases.longest);
    if (scalars.slow > 0)
        end = smaller(end, motion.clock(0) + LONGEST_OF_SLOW);
    if (b)
        copy_motion(motion, space.mark);
    copy_motion(motion, trial);
    const bool ahead = may_step(scalars);
    if (ahead && grid.cycle(c.number) < grid.cycles.shape[1])
        set_steps(form.number, grid.interval(c.number) / PARTS, scalars, steps.parts);
    const Steps *parts = ahead ? &steps.parts : nullptr;
    Index status = next_event(scalars, trial, end, space.search, form.number, ahead ? &steps.search : nullptr);
    double reached = trial.clock(0);
    if (reached > motion.clock(0)) {
        cases.events(c.number, 1) = 0;
        for (Index j = 0; j < c.state.size(); j++)
            if (is_active(c.state(j)))
                add_contact(j, reached, job.grid.interval(c.number), scalars, c, space);
    }
    copy_motion(motion, space.begin);
    read_samples(begin, reached, status != END, form, c, job, b, steps);
    // the samples first: where they exclude a peak none is looked for
    if (grid.cycle(c.number) < grid.cycles.shape[1] && cycle_end(c.number, grid) < reached)
        end_cycle(c.number, cycle_end(c.number, grid), cases.sample(c.number), scalars, space, grid, parts);
    if (grid.cycle(c.number) < grid.cycles.shape[1]) {
        Complex phase = unit_phase(scalars.omega, trial.clock);
        double last = value_now(scalars.lasting.size(), scalars.exponent.size(), phase, scalars, trial);
        add_peaks(c.number, reached, last, cases.sample(c.number), scalars, space, grid, parts);
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
    AllSteps steps[FORMS_AT_HAND];
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
            Index status = to_next_event(begin, until, form, c, job, b, steps[form.number % FORMS_AT_HAND]);
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
            // a rigid impact leaves walls as they are
            walls = before != c.state(pair);
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
