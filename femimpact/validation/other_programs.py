"""Numbers that other programs, a rig and a published map have, beside those computed here: the difference, explained.

The reference of a case is their number as it is printed; the reason of its bound is what explains the difference.
Where that is their step, the same is computed with their step as well and has all their digits.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from femimpact.contact.custom_law import CustomLaw
from femimpact.contact.law import ContactLaw, collide
from femimpact.contact.laws import HuntCrossley, KelvinVoigt, Rigid
from femimpact.errors import InputWarning
from femimpact.excitation.drives import PointForce
from femimpact.excitation.harmonic import Sine
from femimpact.excitation.records import RecordedBase
from femimpact.fem.assembly import assemble
from femimpact.integrators.event_driven import EventDriven
from femimpact.integrators.runs import integrate
from femimpact.integrators.stepping.newmark import MoreauJean, Newmark
from femimpact.orbits.branch import Branch, continue_orbit
from femimpact.orbits.search import find_orbit
from femimpact.response.impacts import Impacts
from femimpact.response.response import Recorder, Response
from femimpact.structure.beam import Beam, Segment
from femimpact.structure.structure import PointMass, Stop, Structure
from femimpact.system.modes import solve_modes
from femimpact.system.reduction import reduce
from femimpact.system.state import State
from femimpact.system.system import System
from femimpact.validation.case import Case
from femimpact.validation.contacts import FREQUENCY, GRAVITY, bouncing
from femimpact.validation.orbits import bifurcation

INF = math.inf
STEP = "their step: see the row with it"
Row: TypeAlias = tuple[str, str, float, float, float, str]
"""What is compared and its unit, their number, ours, how far they may be apart, and why they are."""


def _rows(name: str, source: str, *rows: Row) -> Iterator[Case]:
    """A case for each row: what stands before "at", "of" or a comma is its quantity."""
    for about, unit, theirs, ours, bound, reason in rows:
        quantity = re.split(r",| at | of impact", about)[0]
        yield Case(f"{name}: {about}", source, quantity, unit, theirs, ours, bound, reason)


def _with_stop(mass: float, damping: float, stiffness: float, stop: Stop, constant_force: float = 0.0) -> System:
    """A mass on a spring (kg, N s/m, N/m) before a stop."""
    matrices = ([[mass]], [[damping]], [[stiffness]])
    return System.from_matrices(*matrices, points={"tip": [1.0]}, stops=[stop], constant_load=[constant_force])


def _spring_at(gap: float, stiffness: float, place: str = "tip", fixed_to: str = "base") -> Stop:
    """A stop on the + side that is a spring (m, N/m)."""
    return Stop("wall", place, (gap, INF), KelvinVoigt(stiffness=stiffness, damping=0.0), fixed_to)


def _impacts(system: System, duration: float, displacement: float = 0.0, velocity: float = 0.0) -> Impacts:
    """The impacts of one mass from a state, its base at rest."""
    at_rest, start = RecordedBase([0.0, 0.0], duration), State([displacement], [velocity])
    return integrate(system, at_rest, EventDriven(), duration, Recorder(()), start).impacts


def _settled_branch(system: System, force: Sine, parameter: str, to: tuple[float, float]) -> Branch:
    """The branch through the motion under a force at the tip on which a run of 300 cycles settles."""
    push = PointForce("tip", force)
    run = integrate(system, push, EventDriven(), 300 / force.frequency)
    return continue_orbit(find_orbit(system, push, guess=run), parameter, to)


def _at(run: Response, channel: str, time: float) -> float:
    """A channel at the sample nearest to a time in s."""
    return float(run[channel][np.argmin(np.abs(run.time - time))])


def _explicit_steps(
    step: float, count: int, acceleration: Callable[[float, float, float], float], velocity: float = 0.0
) -> NDArray[np.float64]:
    """Displacements after each of the steps of code_aster's EULER: v + h a(t, u, v), then u + h v, from u = 0."""
    u, v, steps = 0.0, velocity, list[float]()
    for i in range(count):
        v += step * acceleration(i * step, u, v)
        u += step * v
        steps.append(u)
    return np.asarray(steps)


# ---- NLvib and COCO: periodic motions under a sine -----------------------------------------------

PEAKS = ((1.41001, 0.222551, 7e-5), (1.25367, 0.153711, 3.2e-4), (1.54389, 0.334823, 3e-5), (1.12377, 0.103699, 9e-5))
"""Angular frequency, their peak, and how far theirs is off; the orbit of the last one is unstable."""


def nlvib_oscillator() -> Iterator[Case]:
    """A mass with m = 1, c = 0.05, k = 1 under 0.02 cos(w t) before a spring of 100 behind 0.1: peaks over w."""
    system = _with_stop(1.0, 0.05, 1.0, _spring_at(0.1, 100.0))
    branch = _settled_branch(system, Sine(0.02, 1.1 / math.tau), "frequency", (0.9 / math.tau, 1.7 / math.tau))
    reason = "steps a cycle not recorded: by a trapezoidal rule 256 change a peak by up to 8.5e-4, 4,096 by 2e-6"
    rows = list[Row]()
    for omega, peak, bound in PEAKS:
        (orbit,) = (each for each in branch.at(omega / math.tau) if each.is_stable is (omega != PEAKS[-1][0]))
        stability = "stable" if orbit.is_stable else "unstable"
        rows.append((f"peak, w = {omega:g}, {stability}", "m", peak, float(orbit.steady().peak[0]), bound, reason))
    yield from _rows("NLvib, oscillator before a spring", "NLvib 1.3 (Krack and Gross, 2019), a run", *rows)


def nlvib_two_masses() -> Iterator[Case]:
    """Example 03: two masses, the first before a spring of 100 behind 1, the second under 0.1 cos(w t)."""
    K = np.array([[1.0, -1.0], [-1.0, 2.0]])
    points = {"first": [1.0, 0.0], "tip": [0.0, 1.0]}
    stops = [_spring_at(1.0, 100.0, "first")]
    system = reduce(System.from_matrices(np.eye(2), 0.03 * K, K, points=points, stops=stops), 2)
    branch = _settled_branch(system, Sine(0.1, 0.635 / math.tau), "frequency", (0.6 / math.tau, 0.8 / math.tau))
    largest = branch.orbits[int(np.argmax(branch.first_harmonic))]
    orbits = (branch.at(0.635 / math.tau)[0], branch.at(0.6 / math.tau)[0], largest)
    outside = [float(np.sum(np.abs(orbit.multipliers) > 1)) for orbit in orbits]
    about, whole = "multipliers outside the unit circle", "a whole number: they say"
    yield from _rows(
        "NLvib, two masses",
        "NLvib 1.3 (Krack and Gross, 2019), example 03",
        (f"{about}, w = 0.635", "1", 0.0, outside[0], 1e-3, f"{whole} stable"),
        (f"{about}, w = 0.6", "1", 2.0, outside[1], 1e-3, f"{whole} beyond a Neimark-Sacker bifurcation"),
        (f"{about}, largest amplitude", "1", 1.0, outside[2], 1e-3, f"{whole} beyond a period doubling"),
    )


def coco() -> Iterator[Case]:
    """Recipes for Continuation, example 15.2: k = 1, c = 0.1, A cos(t), stop at 1, e = 0.8, over A from 1 down.

    They ask for the point of grazing and print none; it is at A = d sqrt((k - w^2)^2 + (c w)^2).
    """
    system = _with_stop(1.0, 0.1, 1.0, Stop("wall", "tip", (1.0, INF), Rigid(0.8)))
    branch = _settled_branch(system, Sine(1.0, 1.0 / math.tau, math.pi / 2), "amplitude", (0.01, 1.5))
    impact = branch.at(1.0)[0].impacts
    name, source, guess = (
        "COCO, impact oscillator",
        "COCO (Schilder et al., 2020), example 15.2",
        "digits of their guess",
    )
    yield from _rows(
        name,
        source,
        ("velocity after the impact", "m/s", -1.36, -float(impact.rebound_speed[0]), 0.005 / 1.36, guess),
        ("phase at the impact", "rad", 0.076, float(impact.phase[0]) - math.pi / 2, 0.0005 / 0.076, guess),
    )
    yield bifurcation(name, f"{source}; closed form", "grazing", "N", branch, 0.1)


# ---- code_aster ----------------------------------------------------------------------------------


def aster_released_mass() -> Iterator[Case]:
    """SDND101: 100 kg on 1e4 N/m, sent with 1 m/s from rest at a wall of 1e6 N/m."""
    impacts = _impacts(_with_stop(100.0, 0.0, 1e4, _spring_at(0.0, 1e6)), 0.5, velocity=1.0)
    first, second = 0.5 * float(impacts.duration[0]), float(impacts.time[1])
    steps = _explicit_steps(5e-4, 100, lambda _t, u, _v: -1e4 / 100 * u - 1e6 / 100 * max(u, 0.0), 1.0)
    stepped = 5e-4 * 1e6 * float(steps[: int(np.argmax(steps < 0.0))].sum())
    yield from _rows(
        "SDND101, released mass",
        "code_aster (EDF, 2021), sdnd101a.comm",
        ("largest force", "N", 9950.0, float(impacts.peak_force[0]), 5e-5, "4 digits"),
        ("time, first peak", "s", 0.01563, first, 3.2e-4, "4 digits of their closed form"),
        ("time, second peak", "s", 0.361, second + first, 1.4e-4, "a multiple of their step of 0.5 ms"),
        ("duration", "s", 0.03126, 2 * first, 1.6e-4, "4 digits of their closed form"),
        ("impulse", "N s", 198.05, float(impacts.impulse[0]), 1.6e-4, STEP),
        ("impulse, with their step", "N s", 198.05, stepped, 2.53e-5, "5 digits"),
    )


BASE_OMEGA = 20 * math.pi
POSITIONS = (
    *((0.05, -3.58082e-4, 2.5e-4), (0.156, -1.22321e-4, 1.8e-3), (0.25, -1.8876e-4, 3.5e-4), (0.4, -1.89772e-4, 4e-4)),
    *((0.5, -6.84454e-5, 2.7e-2), (0.8, -1.11982e-4, 1.7e-2), (0.9, -1.20103e-4, 9e-3), (1.0, -1.07178e-4, 1.4e-2)),
)
"""Time (s), their position in space (m), and how far it is off by their step."""


def aster_shaken_mass() -> Iterator[Case]:
    """SDND102: 25 kg, 98696 N/m, 7 %, its base at -sin(20 pi t)/(20 pi)^2, a stop of 5.76e7 N/m at 0.5 mm in space."""
    mass, stiffness, stop = 25.0, 98696.0, 5.76e7
    omega = math.sqrt(stiffness / mass)
    rate = 2 * 0.07 * omega
    sampled = np.linspace(0.0, 1.0, 10001)
    displacements = -np.sin(BASE_OMEGA * sampled) / BASE_OMEGA**2

    def base(time: float) -> float:
        # they sample the sine every 0.1 ms
        return float(np.interp(time, sampled, displacements))

    def acceleration(time: float, u: float, v: float) -> float:
        pressed = max(u + base(time) - 5e-4, 0.0)
        return BASE_OMEGA**2 * base(time) - rate * v - omega**2 * u - stop / mass * pressed

    system = _with_stop(mass, rate * mass, stiffness, _spring_at(5e-4, stop, fixed_to="space"))
    shaken = Sine(1 / BASE_OMEGA**2, 10.0, math.pi)
    run = integrate(system, shaken, EventDriven(), 1.0, Recorder(("tip",), interval=1e-3))
    steps = _explicit_steps(2.5e-4, 4000, acceleration)
    rows = list[Row]()
    for time, position, off in POSITIONS:
        exact, stepped = _at(run, "tip", time), float(steps[round(time / 2.5e-4) - 1])
        about = f"position in space at {time:g} s"
        rows.append((about, "m", position, exact + base(time), off, STEP))
        digit = 0.5 * 10 ** (math.floor(math.log10(-position)) - 5) / -position
        rows.append((f"{about}, with their step", "m", position, stepped + base(time), digit, "6 digits"))
    yield from _rows("SDND102, shaken mass", "code_aster (EDF, 2021), sdnd102a.comm", *rows)


def aster_beam() -> Iterator[Case]:
    """SDNL104: a round cantilever of 10 elements under -1000 N at its tip, between springs of 1e8 N/m at 0.1 mm."""
    beam = Beam.round(length=1.0, diameter=0.2, young_modulus=1e10, density=1e6)
    structure = Structure(beam, stops=[Stop("support", "tip", 1e-4, KelvinVoigt(stiffness=1e8, damping=0.0))])
    with warnings.catch_warnings():
        # a density of 1e6 kg/m^3 is meant
        warnings.simplefilter("ignore", InputWarning)
        system = assemble(structure, elements=10)
    push, channels = PointForce("tip", RecordedBase([-1000.0, -1000.0], 0.2)), ("tip", "tip.velocity")
    exact = integrate(reduce(system, 20), push, EventDriven(), 0.16, Recorder(channels, interval=1e-4))
    stepped = integrate(system, push, Newmark(1e-4), 0.16, Recorder(channels))
    newton = "7 digits and more: their iteration for the contact"
    for way, run, bounds, reason in (
        ("", exact, (7.5e-3, 7e-3, 6.5e-4), STEP),
        (", with their Newmark step", stepped, (6e-7, 6e-8, 7e-9), newton),
    ):
        assert run.energy is not None
        u, v, energy = _at(run, "tip", 0.1315), _at(run, "tip.velocity", 0.1566), run.energy.kinetic
        yield from _rows(
            "SDNL104, beam between springs",
            "code_aster (EDF, 2021), sdnl104d.comm",
            (f"displacement at 0.1315 s{way}", "m", -1.8533389678e-06, u, bounds[0], reason),
            (f"velocity at 0.1566 s{way}", "m/s", -4.6328401459e-03, v, bounds[1], reason),
            (f"kinetic energy at 0.16 s{way}", "J", 0.0514080228, float(energy[-1]), bounds[2], reason),
        )


def aster_nonlinear_mode() -> Iterator[Case]:
    """SDND122: 1 kg on 10 N/m, free, before a spring of 50 N/m behind 0.01 m, at an energy of 6.5 mJ.

    1/f = (2/w0) acos(-g/a) + (2/w1) acos(sqrt(k/((k + K) 2 E/(k g^2) - K))), w0^2 = k/m, w1^2 = (k + K)/m,
    a^2 = 2 E/k. They leave out the - K: the spring takes up no energy before the gap is closed.
    """
    k, spring, gap, energy = 10.0, 50.0, 0.01, 0.00650108331626
    times = _impacts(_with_stop(1.0, 0.0, k, _spring_at(gap, spring)), 400.0, velocity=math.sqrt(2 * energy)).time
    computed, ratio = float((times.size - 1) / (times[-1] - times[0])), 2 * energy / (k * gap**2)

    def frequency(term: float) -> float:
        away = 2 * math.acos(-1 / math.sqrt(ratio)) / math.sqrt(k)
        at_spring = 2 * math.acos(math.sqrt(k / ((k + spring) * ratio - term))) / math.sqrt(k + spring)
        return 1 / (away + at_spring)

    left_out = "theirs leaves out a term: see the row with it"
    between = "read between points of their branch; their file calls its tolerance unexplained"
    yield from _rows(
        "SDND122, nonlinear mode",
        "code_aster (EDF, 2021), sdnd122a.comm",
        ("frequency, their closed form", "Hz", frequency(0.0), computed, 6.5e-4, left_out),
        ("frequency, their closed form with the term", "Hz", frequency(spring), computed, 1e-12, "rounding"),
        ("frequency, their harmonic balance", "Hz", 0.64669392749957, computed, 1e-4, between),
    )


# ---- bars and masses that meet a rigid floor -----------------------------------------------------


def _bar(elements: int, element: float, lumped: float, axial: float, mass: float, gap: float, pull: float) -> System:
    """A free bar of linear elements of a length (m) over a floor; EA in N, mass in kg/m, pull in m/s^2.

    Its mass matrix is the consistent one, and the lumped one by a share.
    """
    nodes = elements + 1
    K, M = np.zeros((nodes, nodes)), np.zeros((nodes, nodes))
    for i in range(elements):
        part = np.s_[i : i + 2, i : i + 2]
        K[part] += axial / element * np.array([[1.0, -1.0], [-1.0, 1.0]])
        consistent = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6
        M[part] += mass * element * ((1 - lumped) * consistent + lumped * np.eye(2) / 2)
    floor, bottom, load = Stop("floor", "bottom", (INF, gap), Rigid(0.0)), np.eye(nodes)[0], -pull * M.sum(axis=1)
    return System.from_matrices(M, 0 * M, K, points={"bottom": bottom}, stops=[floor], constant_load=load)


def bouncing_bar() -> Iterator[Case]:
    """A bar of 10 m dropped from 5 m: it touches for 2 L/c, flies, and touches again until its waves cancel."""
    for elements, bounds in ((20, (9e-3, 1e-2, 4e-3, 0.31)), (100, (2.5e-3, 2.1e-3, 6e-4, 0.09))):
        system = reduce(_bar(elements, 10 / elements, 0.5, 900.0, 1.0, 5.0, 10.0), elements + 1)
        at_rest, kept = RecordedBase([0.0, 0.0], 6.0), Recorder(("bottom",), interval=1 / 3)
        run = integrate(system, at_rest, EventDriven(), 16 / 3, kept)
        (begin, again), (end, last) = run.sticking.start.tolist(), run.sticking.end.tolist()
        yield from _rows(
            f"bouncing bar, {elements} elements",
            "Doyen et al. (2011), exact, in NLstep (Krack and Gross, 2025)",
            ("first contact begins", "s", 1.0, begin, 1e-12, "rounding"),
            ("first contact ends", "s", 5 / 3, end, bounds[0], "the mesh"),
            ("second contact begins", "s", 11 / 3, again, bounds[1], "the mesh"),
            ("second contact ends", "s", 13 / 3, last, bounds[2], "the mesh"),
            ("displacement at 16/3 s", "m", 0.0, float(run["bottom"][-1]), bounds[3], "the mesh"),
        )


def siconos_bar() -> Iterator[Case]:
    """A bar of 99 elements that meets a floor at 0.1 m/s: its impulse, and for how long it touches."""
    area = 0.000314
    system = _bar(99, 0.01, 0.0, 210e9 * area, 7800 * area, 5e-5, 0.0)
    at_rest, stepping = RecordedBase([0.0, 0.0], 1e-3), MoreauJean(2e-6, allow_coarse_step=True)
    impacts = integrate(system, at_rest, stepping, 1e-3, Recorder(()), State(np.zeros(100), np.full(100, -0.1))).impacts
    impulse, duration, same = impacts.impulse.sum(), impacts.duration.sum(), "the same rule, mesh and step: rounding"
    yield from _rows(
        "Siconos, bar on a floor",
        "Siconos (INRIA, 2024), ImpactingBar.ref",
        ("impulse, Moreau-Jean, 2 us", "N s", 0.481427422067891, float(impulse), 1e-12, same),
        ("duration, Moreau-Jean, 2 us", "s", 3.82e-4, float(duration), 1e-12, same),
    )


def siconos_masses() -> Iterator[Case]:
    """A ball dropped from 1 m, and a mass of 1 g on a spring of 100 N/m let go at 1 m, both with e = 0.9."""
    below, here = (Stop("floor", "tip", (INF, gap), Rigid(0.9)) for gap in (1.0, 0.0))
    ball = _impacts(_with_stop(1.0, 0.0, 0.0, below, -GRAVITY), 8.5)
    mass = _impacts(_with_stop(1e-3, 0.0, 100.0, here, -1e-3 * GRAVITY), 0.5, displacement=1.0)
    (time, speed), (later, slower) = ((run.time.tolist(), run.rebound_speed.tolist()) for run in (ball, mass))
    tolerance = "both event-driven: tolerance of theirs"
    yield from _rows(
        "Siconos",
        "Siconos (INRIA, 2024), BouncingBallED.ref and LinearOscillatorED.ref",
        ("time of impact 24, ball", "s", 7.858620482597298, time[23], 5e-12, tolerance),
        ("rebound speed of impact 24, ball", "m/s", 0.3533212254519507, speed[23], 5e-12, tolerance),
        ("time of impact 50, mass on a spring", "s", 0.4906846902365521, later[49], 5e-12, tolerance),
        ("rebound speed of impact 50, mass on a spring", "m/s", 1.629926692640904, slower[49], 5e-12, tolerance),
    )


def exudyn_spheres() -> Iterator[Case]:
    """Restitution of spheres of 1.6 kg that meet at 10 m/s, in steps of 10 or 20 us."""
    mass, speed, stiffness = 1.6, 10.0, 1e6
    loss = 1.5 * (1 - 0.5) * (11 - 0.5) / (1 + 9 * 0.5)
    # their loss factor of Gonthier et al. and of Carvalho and Martins
    theirs = CustomLaw(lambda depth, rate, approach: max(stiffness * depth * (1 + loss * rate / approach), 0.0))
    laws: dict[str, ContactLaw] = {f"Hunt-Crossley, e = {e:g}": HuntCrossley(stiffness, e) for e in (0.9, 0.5, 0.1)}
    laws |= {"Gonthier/Carvalho-Martins, e = 0.5": theirs}
    hunt, gonthier = "their step", "their step; their loss factor is an approximation, and gives 0.50017"
    yield from _rows(
        "Exudyn, spheres",
        "Exudyn (Gerstmayr, 2025), contactSphereSphereTest.py",
        *(
            (
                f"restitution, {name}, {step} us",
                "1",
                published,
                collide(laws[name], mass, speed).restitution,
                bound,
                why,
            )
            for name, step, published, bound, why in (
                ("Hunt-Crossley, e = 0.9", 20, 0.9090298887177969, 1.6e-5, hunt),
                ("Hunt-Crossley, e = 0.5", 20, 0.6629838391096419, 3.4e-5, hunt),
                ("Hunt-Crossley, e = 0.1", 20, 0.5158573889338283, 5e-5, hunt),
                ("Gonthier/Carvalho-Martins, e = 0.5", 20, 0.5001975126052718, 5e-5, gonthier),
                ("Gonthier/Carvalho-Martins, e = 0.5", 10, 0.5001784818335925, 1e-5, gonthier),
            )
        ),
    )


def bouncing_ball_map() -> Iterator[Case]:
    """A ball on a vibrating table, e = 0.5: between which amplitudes it bounces once a cycle.

    The map is phi1 = phi + v, v1 = e v - c cos(phi1), c = 2 (1 + e) w^2 A/g. Its fixed point v = 2 pi,
    cos(phi) = -2 pi (1 - e)/c begins at c = 2 pi (1 - e) and doubles its period where c sin(phi) = -2 (1 + e).
    """
    e, unit_amplitude = 0.5, GRAVITY / (math.tau * FREQUENCY) ** 2
    run = bouncing(e, 1.0, 20)
    orbit = find_orbit(run.system, run.base, guess=run)
    branch = continue_orbit(orbit, "amplitude", (0.9 * unit_amplitude, 1.8 * unit_amplitude))
    fold = math.pi * (1 - e) / (1 + e)
    moving = unit_amplitude * math.hypot(fold, 2 * (1 + e**2) / (1 + e) ** 2)
    name, source = "ball on a vibrating table", "derived here from the map of Holmes (1982)"
    yield bifurcation(name, source, "fold", "m", branch, unit_amplitude * fold)
    doubling = bifurcation(f"{name}, which moves", "derived here (momentum)", "period-doubling", "m", branch, moving)
    yield doubling
    still = unit_amplitude * math.hypot(fold, 1.0)
    reason = "the map takes the table for still: see the row where it moves"
    yield from _rows(name, source, ("value of the parameter, doubling", "m", still, doubling.computed, 5.5e-2, reason))


# ---- a rig ---------------------------------------------------------------------------------------

RIG = ((30.95, 2e-4), (199.04, 1.6e-2), (556.82, 7e-3), (1085.93, 4.5e-3))
"""Natural frequencies of the left beam, Hz, and how far its model is off."""


def rig_of_two_beams() -> Iterator[Case]:
    """The left one of two cantilevers that collide in a rig, alone: a plate of 40 mm bolted on, a nut at the tip.

    Their model has 0.75 of the bending stiffness under the plate, set by trial to meet the frequencies of the rig.
    """
    modulus, density, width, height, plate = 210e9, 7720.0, 60e-3, 6e-3, 40e-3
    thick = height + 1e-3 * plate / width
    heavy = (density * plate * width * height + 42.7e-3) / (plate * width * thick)
    to_plate = Segment(0.29, modulus, density, width, height, name="to the plate")
    beyond = Segment(0.0625, modulus, density, width, height, name="beyond the plate")
    beam = Beam([to_plate, Segment(plate, 0.75 * modulus, heavy, width, thick, name="plate"), beyond])
    structure = Structure(beam, [PointMass("nut", 0.381, 13.3e-3)])
    frequencies = solve_modes(assemble(structure, elements=40), count=len(RIG)).natural_frequency.tolist()
    bolts = "bolts: the stiffness under the plate is set by trial; their model is this one"
    yield from _rows(
        "rig of two colliding beams, the left one",
        "rig of Woiwode and Krack (2024), in NLtest",
        *(
            (f"frequency, mode {mode}", "Hz", theirs, ours, bound, bolts)
            for mode, ((theirs, bound), ours) in enumerate(zip(RIG, frequencies, strict=True), 1)
        ),
    )


PROGRAMS: tuple[Callable[[], Iterator[Case]], ...] = (
    *(nlvib_oscillator, nlvib_two_masses, coco),
    *(aster_released_mass, aster_shaken_mass, aster_beam, aster_nonlinear_mode),
    *(bouncing_bar, siconos_bar, siconos_masses, exudyn_spheres, bouncing_ball_map, rig_of_two_beams),
)
"""Functions that run cases, each those of one source."""
