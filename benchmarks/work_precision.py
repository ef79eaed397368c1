"""Work and precision of every method on the reference study, measured side by side in one run.

The tip over the first 0.8 s at 5.2 Hz from rest (some five impacts; later, chaos decides), 8 modes,
restitution 0.7. Two problems, each with its own converged solution:

- rigid impacts: event-driven is exact; Moreau-Jean steps them; Newmark with ever stiffer walls
  comes near (its dashpot made for the mass that acts in a rigid impact);
- Kelvin-Voigt walls of 2 ms contact time: event-driven is exact there too, and is held
  against Newmark with a tiny step; Newmark and its family, energy-consistent contact, and a coarse
  step between contacts with a fine one in touch.

Error: largest difference of the tip over the largest tip. Cost: CPU time of one core.

    python benchmarks/work_precision.py [--output work_precision.png]
"""

from __future__ import annotations

import argparse
import platform
import time
from dataclasses import dataclass

import numpy as np
import report

import femimpact as fi
from femimpact.contact.law import resolve
from femimpact.figures.drawing import COLOURS, GREY, panels

DURATION, FREQUENCY, AMPLITUDE, MODES, RESTITUTION = 0.801, 5.2, 0.2037e-3, 8, 0.7
SINE = fi.Sine(AMPLITUDE, FREQUENCY)
PER_CYCLE = 200
GRID = np.arange(1, 833) / (FREQUENCY * PER_CYCLE)
"""Instants at which tips are compared, s: those that the event-driven run reads."""

MOTION_LIMIT = 10.0
"""Microseconds per motion between impacts that an event-driven run near resonance may take."""


@dataclass(frozen=True)
class Point:
    """One run: its problem, method and setting, error (1) and CPU time (s)."""

    problem: str
    method: str
    setting: str
    error: float
    seconds: float


def structure(contact):
    """The reference study with another contact."""
    return fi.Structure(
        beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
        impactors=[fi.Impactor("ball", at="tip", mass=3.43e-3, gap=4e-3, contact=contact)],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )


def system_with(contact):
    """Its equations on the modes kept."""
    return fi.reduce(fi.assemble(structure(contact), elements=40), MODES)


def soft_wall(contact_time):
    """Kelvin-Voigt wall whose restitution holds for all kept modes together."""
    rigid = system_with(fi.Rigid(RESTITUTION))
    row = rigid.contacts[0].direction
    mass = 1.0 / (1.0 / rigid.contacts[0].mass + float(row @ row))
    numbers = resolve(fi.KelvinVoigt(restitution=RESTITUTION, contact_time=contact_time), mass)
    return fi.KelvinVoigt(stiffness=numbers.stiffness, damping=numbers.damping)


def tip(system, method):
    """The tip on a common grid, and the CPU time of the best of three runs."""
    record = fi.Recorder(channels=("tip",), ledger=False)
    best = np.inf
    for _ in range(3):
        start = time.process_time()
        response = fi.integrate(system, SINE, method, DURATION, record)
        best = min(best, time.process_time() - start)
    return np.interp(GRID, response.time, response["tip"]), best


def error_of(values, exact):
    """Largest difference over the largest value."""
    return float(np.max(np.abs(values - exact)) / np.max(np.abs(exact)))


def event_driven(samples_per_cycle):
    """Event-driven, read at the grid's instants (and between them, where more samples are asked for)."""
    return fi.EventDriven(samples_per_cycle=samples_per_cycle)


def event_driven_point(problem, system):
    """The event-driven run as the problem's exact solution, and its point."""
    # the same motion read ten times as often is summed up in other pieces: their difference is its rounding
    exact, _ = tip(system, event_driven(10 * PER_CYCLE))
    values, seconds = tip(system, event_driven(PER_CYCLE))
    return exact, Point(problem, "event-driven", "exact", error_of(values, exact), seconds)


def rigid_points():
    """Rigid impacts: event-driven, Moreau-Jean, and Newmark with ever stiffer walls."""
    system = system_with(fi.Rigid(RESTITUTION))
    exact, point = event_driven_point("rigid", system)
    points = [point]
    for dt in (4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5, 6e-6):
        values, seconds = tip(system, fi.MoreauJean(dt=dt))
        points.append(Point("rigid", "Moreau-Jean", f"dt {dt:g}", error_of(values, exact), seconds))
    for contact_time in (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6e-5):
        soft = system_with(soft_wall(contact_time))
        values, seconds = tip(soft, fi.Newmark(dt=contact_time / 20))
        points.append(Point("rigid", "Newmark, stiff wall", f"T_c {contact_time:g}", error_of(values, exact), seconds))
    return points


def compliant_methods(dt):
    """Every method for compliant contact at one step."""
    coarse = {"allow_coarse_step": True}
    return {
        "Newmark": fi.Newmark(dt=dt, **coarse),
        "Newmark, energy-consistent": fi.Newmark(dt=dt, contact="energy-consistent", **coarse),
        "HHT, -0.1": fi.HHT(dt=dt, alpha=-0.1, **coarse),
        "WBZ, -0.1": fi.WBZ(dt=dt, alpha=-0.1, **coarse),
        "generalised alpha, 0.8": fi.GeneralizedAlpha(dt=dt, spectral_radius=0.8, **coarse),
        "Newmark, refined 10 times in touch": fi.Newmark(dt=10 * dt, refine=10, **coarse),
    }


def compliant_points(contact_time=2e-3):
    """Kelvin-Voigt walls: the family over the step."""
    system = system_with(soft_wall(contact_time))
    exact, point = event_driven_point("compliant", system)
    points = [point]
    for steps in (5, 10, 20, 40, 80, 160, 320):
        dt = contact_time / steps
        for name, method in compliant_methods(dt).items():
            values, seconds = tip(system, method)
            points.append(Point("compliant", name, f"T_c/{steps}", error_of(values, exact), seconds))
    return points


def agreement(contact_time=2e-3):
    """How far Newmark, energy-consistent, with a tiny step (s) is from the event-driven solution."""
    system, dt = system_with(soft_wall(contact_time)), contact_time / 10_000
    exact, _ = tip(system, event_driven(PER_CYCLE))
    values, _ = tip(system, fi.Newmark(dt=dt, contact="energy-consistent"))
    return dt, error_of(values, exact)


def motion_cost():
    """Microseconds for each motion between impacts near resonance, 600 s, sampling included."""
    system = system_with(fi.Rigid(0.78))
    record = fi.Recorder(channels=("tip",), ledger=False)
    best, count = np.inf, 1
    for _ in range(5):
        start = time.process_time()
        run = fi.integrate(system, fi.Sine(AMPLITUDE, 4.91), fi.EventDriven(), 600.0, record)
        best, count = min(best, time.process_time() - start), len(run.impacts)
    return 1e6 * best / count, count


def figure_of(points, path):
    """Error over cost, one panel a problem."""
    axes = panels(fi.figures.OffScreen(), 11.0, 5.0, 1, 2, sharey=True)[0]
    titles = {"rigid": "rigid impacts, e = 0.7", "compliant": "Kelvin-Voigt walls, contact time 2 ms"}
    colours = (*COLOURS, "black", GREY)
    for axis, problem in zip(axes, titles, strict=True):
        mine = [point for point in points if point.problem == problem]
        names = dict.fromkeys(point.method for point in mine)
        for name, colour, marker in zip(names, colours, "os^Dvx+", strict=False):
            own = [point for point in mine if point.method == name]
            axis.loglog([1e3 * p.seconds for p in own], [p.error for p in own], marker + "-", color=colour, label=name)
        axis.set_xticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"])
        axis.minorticks_off()
        axis.set_xlim(0.8, 60.0)
        axis.set_xlabel("CPU time for 0.8 s of motion (ms)")
        axis.set_title(titles[problem], loc="left")
        axis.legend(frameon=False, fontsize=9)
    axes[0].set_ylabel("error of the tip, share of its largest")
    fi.figures.save_figure(axes, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", default="work_precision.png")
    parser.add_argument("--table", help="CSV file of the table on the page docs/howto/methods.md")
    options = parser.parse_args()
    # what is loaded and kept from here on is paid for once
    for contact in (fi.Rigid(RESTITUTION), soft_wall(2e-3)):
        fi.integrate(system_with(contact), SINE, event_driven(PER_CYCLE), 0.2)
    points = [*rigid_points(), *compliant_points()]
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, CPU time of one core\n")
    rows = [(p.problem, p.method, p.setting, f"{p.error:.2e}", f"{1e3 * p.seconds:.2f}") for p in points]
    header = ("problem", "method", "setting", "error", "CPU time (ms)")
    print(report.markdown(header, rows), "\n")
    if options.table:
        report.write_csv(options.table, header, rows)
    for problem in ("rigid", "compliant"):
        mine = [p for p in points if p.problem == problem]
        event, best = mine[0], min(mine[1:], key=lambda p: p.error)
        print(
            f"{problem}: event-driven {event.error:.1e} in {1e3 * event.seconds:.2f} ms; the most exact of the others, "
            f"{best.method} at {best.setting}: {best.error:.1e} in {1e3 * best.seconds:.2f} ms, "
            f"{best.seconds / event.seconds:.0f} times the time"
        )
    dt, apart = agreement()
    print(f"compliant: Newmark, energy-consistent, with dt = {dt:g} s is {apart:.1e} from the event-driven solution")
    micro, count = motion_cost()
    verdict = "within" if micro <= MOTION_LIMIT else "beyond"
    print(
        f"motion between two impacts: {micro:.1f} us over {count} of them, {verdict} the limit of {MOTION_LIMIT:g} us"
    )
    figure_of(points, options.output)
    print("wrote", options.output)


if __name__ == "__main__":
    main()
