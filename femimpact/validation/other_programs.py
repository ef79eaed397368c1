"""Numbers that other programs, a rig and a published map have, beside those computed here: the difference, explained.

The reference of a case is their number as it is printed; the reason of its bound is what explains the difference.
Where that is their step, the same is computed with their step as well and has all their digits.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterator
from decimal import Decimal
from functools import partial
from typing import TypeAlias

import numpy as np

from femimpact.contact.law import collide
from femimpact.contact.laws import HuntCrossley, KelvinVoigt, Rigid
from femimpact.errors import InputWarning
from femimpact.excitation.drives import PointForce, Rest
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
from femimpact.validation.orbits import LOCATED, nearest_bifurcation

INF = math.inf
DIGITS = 0.0
"""As the bound of a row: half a unit of the last digit of their number."""
STEP = "their step: see the row with it"
MESH = "the mesh"
Row: TypeAlias = tuple[str, str, float, float, float, str]
"""What is compared and its unit, their number, ours, how far they may be apart, and why they are."""


def _cases(rows: Callable[[], Iterator[Row]], name: str, source: str) -> Iterator[Case]:
    """A case for each row: what stands before "at", "of" or a comma is its quantity."""
    for about, unit, theirs, ours, bound, reason in rows():
        quantity = re.split(r",| at | of impact", about)[0]
        last_digit = 10.0 ** int(Decimal(repr(theirs).removesuffix(".0")).as_tuple().exponent)
        within = bound or 0.5 * last_digit / abs(theirs)
        yield Case(f"{name}: {about}", source, quantity, unit, theirs, ours, within, reason)


def _with_stop(mass: float, damping: float, stiffness: float, stop: Stop, constant_force: float = 0.0) -> System:
    """A mass on a spring (kg, N s/m, N/m) before a stop."""
    matrices = ([[mass]], [[damping]], [[stiffness]])
    return System.from_matrices(*matrices, points={"tip": [1.0]}, stops=[stop], constant_load=[constant_force])


def _spring_at(gap: float, stiffness: float, place: str = "tip", fixed_to: str = "base") -> Stop:
    """A stop on the + side that is a spring (m, N/m)."""
    return Stop("wall", place, (gap, INF), KelvinVoigt(stiffness=stiffness, damping=0.0), fixed_to)


def _impacts(system: System, duration: float, displacement: float = 0.0, velocity: float = 0.0) -> Impacts:
    """The impacts of one mass from a state, its base at rest."""
    return integrate(system, Rest(), EventDriven(), duration, Recorder(()), State([displacement], [velocity])).impacts


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
) -> list[float]:
    """Displacements after each of the steps of code_aster's EULER: v + h a(t, u, v), then u + h v, from u = 0."""
    u, v, steps = 0.0, velocity, list[float]()
    for i in range(count):
        v += step * acceleration(i * step, u, v)
        u += step * v
        steps.append(u)
    return steps


# ---- NLvib and COCO: periodic motions under a sine -----------------------------------------------

PEAKS = (
    *((1.41001, 0.222551, 7e-5, 1.5e-5), (1.25367, 0.153711, 3.2e-4, 7.4e-5)),
    *((1.54389, 0.334823, 3e-5, 3.0e-6), (1.12377, 0.103699, 9e-5, 1.4e-5)),
)
"""Angular frequency, their peak, how far it is off, and how far a cycle is from closed (m) that has it."""


def nlvib_oscillator() -> Iterator[Row]:
    """A mass with m = 1, c = 0.05, k = 1 under 0.02 cos(w t) before a spring of 100 behind 0.1: peaks over w."""
    system = _with_stop(1.0, 0.05, 1.0, _spring_at(0.1, 100.0))
    branch = _settled_branch(system, Sine(0.02, 1.1 / math.tau), "frequency", (1.09 / math.tau, 1.56 / math.tau))
    for omega, theirs, bound, open_by in PEAKS:
        # that of the last one is unstable
        (orbit,) = (each for each in branch.at(omega / math.tau) if each.is_stable is (omega != PEAKS[-1][0]))
        about = f"peak, w = {omega:g}, {'stable' if orbit.is_stable else 'unstable'}"
        reason = f"a cycle that is {open_by:.1e} m from closed has their peak; steps and stop are not recorded"
        yield about, "m", theirs, float(orbit.steady().peak[0]), bound, reason


def nlvib_two_masses() -> Iterator[Row]:
    """Example 03: two masses, the first before a spring of 100 behind 1, the second under 0.1 cos(w t)."""
    K = np.array([[1.0, -1.0], [-1.0, 2.0]])
    points = {"first": [1.0, 0.0], "tip": [0.0, 1.0]}
    stops = [_spring_at(1.0, 100.0, "first")]
    system = reduce(System.from_matrices(np.eye(2), 0.03 * K, K, points=points, stops=stops), 2)
    branch = _settled_branch(system, Sine(0.1, 0.635 / math.tau), "frequency", (0.6 / math.tau, 0.755 / math.tau))
    largest = int(np.argmax(branch.first_harmonic))
    for place, theirs, orbit, stability in (
        ("w = 0.635", 0.0, branch.at(0.635 / math.tau)[0], "stable"),
        ("w = 0.6", 2.0, branch.at(0.6 / math.tau)[0], "beyond a Neimark-Sacker bifurcation"),
        ("largest amplitude", 1.0, branch.orbits[largest], "beyond a period doubling"),
    ):
        outside = float(np.sum(np.abs(orbit.multipliers) > 1))
        yield f"multipliers outside the unit circle, {place}", "1", theirs, outside, 1e-3, f"they say {stability}"
    for kind, low, high, where in (
        ("Neimark-Sacker", 0.6, 0.635, "w = 0.6 to 0.635"),
        ("period-doubling", 0.635, math.tau * branch.values[largest], "w = 0.635 to the largest amplitude"),
    ):
        crossed = [math.tau * each.value for each in branch.bifurcations if each.kind == kind.lower()]
        between = [omega for omega in crossed if low < omega < high]
        reason = f"they say beyond one; ours is at w = {', '.join(f'{omega:.5f}' for omega in between)}"
        yield f"{kind} bifurcations, {where}", "1", 1.0, float(len(between)), 1e-3, reason
    harmonic = max(float(orbit.steady("first").first_harmonic[0]) for orbit in branch.at(0.7541 / math.tau))
    reason = "21 harmonics change it by 1.0e-3, and where Octave's fsolve stops, by 4e-4"
    yield "first harmonic, mass before the spring, w = 0.7541", "m", 1.326954, harmonic, 1.5e-3, reason


def coco() -> Iterator[Row]:
    """Recipes for Continuation, example 15.2: k = 1, c = 0.1, A cos(t), stop at 1, e = 0.8, over A from 1 down.

    They ask for the point of grazing and print none; it is at A = d sqrt((k - w^2)^2 + (c w)^2).
    """
    system = _with_stop(1.0, 0.1, 1.0, Stop("wall", "tip", (1.0, INF), Rigid(0.8)))
    branch = _settled_branch(system, Sine(1.0, 1.0 / math.tau, math.pi / 2), "amplitude", (0.01, 1.5))
    impact, guess = branch.at(1.0)[0].impacts, "digits of their guess"
    yield "velocity after the impact", "m/s", -1.36, -float(impact.rebound_speed[0]), DIGITS, guess
    yield "phase at the impact", "rad", 0.076, float(impact.phase[0]) - math.pi / 2, DIGITS, guess
    yield "amplitude at grazing, closed form", "N", 0.1, nearest_bifurcation(branch, "grazing", 0.1), 1e-10, LOCATED


# ---- code_aster ----------------------------------------------------------------------------------


def aster_released_mass() -> Iterator[Row]:
    """SDND101: 100 kg on 1e4 N/m, sent with 1 m/s from rest at a wall of 1e6 N/m."""
    impacts = _impacts(_with_stop(100.0, 0.0, 1e4, _spring_at(0.0, 1e6)), 0.5, velocity=1.0)
    first, second = 0.5 * float(impacts.duration[0]), float(impacts.time[1])
    steps = _explicit_steps(5e-4, 100, lambda _t, u, _v: -1e4 / 100 * u - 1e6 / 100 * max(u, 0.0), 1.0)
    stepped = 5e-4 * 1e6 * sum(steps[: next(i for i, u in enumerate(steps) if u < 0)])
    yield "largest force", "N", 9950.0, float(impacts.peak_force[0]), DIGITS, "4 digits"
    yield "time, first peak", "s", 0.01563, first, DIGITS, "4 digits of their closed form"
    yield "time, second peak", "s", 0.361, second + first, 1.4e-4, "a multiple of their step of 0.5 ms"
    yield "duration", "s", 0.03126, 2 * first, DIGITS, "4 digits of their closed form"
    yield "impulse", "N s", 198.05, float(impacts.impulse[0]), 1.6e-4, STEP
    yield "impulse, with their step", "N s", 198.05, stepped, DIGITS, "5 digits"


def aster_shaken_mass() -> Iterator[Row]:
    """SDND102: 25 kg, 98696 N/m, 7 %, its base at -sin(20 pi t)/(20 pi)^2, a stop of 5.76e7 N/m at 0.5 mm in space."""
    mass, stiffness, stop, shaking = 25.0, 98696.0, 5.76e7, 20 * math.pi
    omega = math.sqrt(stiffness / mass)
    rate = 2 * 0.07 * omega
    sampled = np.linspace(0.0, 1.0, 10001)
    displacements = -np.sin(shaking * sampled) / shaking**2

    def base(time: float) -> float:
        # they sample the sine every 0.1 ms
        return float(np.interp(time, sampled, displacements))

    def acceleration(time: float, u: float, v: float) -> float:
        pressed = max(u + base(time) - 5e-4, 0.0)
        return shaking**2 * base(time) - rate * v - omega**2 * u - stop / mass * pressed

    system = _with_stop(mass, rate * mass, stiffness, _spring_at(5e-4, stop, fixed_to="space"))
    sine, kept = Sine(1 / shaking**2, 10.0, math.pi), Recorder(("tip",), interval=1e-3)
    run = integrate(system, sine, EventDriven(), 1.0, kept)
    steps = _explicit_steps(2.5e-4, 4000, acceleration)
    for time, theirs, bound in (
        *((0.05, -3.58082e-4, 2.5e-4), (0.156, -1.22321e-4, 1.8e-3), (0.25, -1.8876e-4, 3.5e-4)),
        *((0.4, -1.89772e-4, 4e-4), (0.5, -6.84454e-5, 2.7e-2), (0.8, -1.11982e-4, 1.7e-2)),
        *((0.9, -1.20103e-4, 9e-3), (1.0, -1.07178e-4, 1.4e-2)),
    ):
        about = f"position in space at {time:g} s"
        yield about, "m", theirs, _at(run, "tip", time) + base(time), bound, STEP
        stepped, digit = steps[round(time / 2.5e-4) - 1] + base(time), 10 ** (math.floor(math.log10(-theirs)) - 5)
        yield f"{about}, with their step", "m", theirs, stepped, 0.5 * digit / -theirs, "6 digits"


def aster_beam() -> Iterator[Row]:
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
    for way, run, (of_u, of_v, of_energy), reason in (
        ("", exact, (7.5e-3, 7e-3, 6.5e-4), STEP),
        (", with their Newmark step", stepped, (6e-7, 6e-8, 7e-9), newton),
    ):
        assert run.energy is not None
        u, v, energy = _at(run, "tip", 0.1315), _at(run, "tip.velocity", 0.1566), float(run.energy.kinetic[-1])
        yield f"displacement at 0.1315 s{way}", "m", -1.8533389678e-06, u, of_u, reason
        yield f"velocity at 0.1566 s{way}", "m/s", -4.6328401459e-03, v, of_v, reason
        yield f"kinetic energy at 0.16 s{way}", "J", 0.0514080228, energy, of_energy, reason


def aster_nonlinear_mode() -> Iterator[Row]:
    """SDND122: 1 kg on 10 N/m, free, before a spring of 50 N/m behind 0.01 m, at an energy of 6.5 mJ.

    Their closed form leaves out a term: the spring takes up no energy before the gap is closed.
    """
    k, spring, gap, energy = 10.0, 50.0, 0.01, 0.00650108331626
    times = _impacts(_with_stop(1.0, 0.0, k, _spring_at(gap, spring)), 400.0, velocity=math.sqrt(2 * energy)).time
    computed, ratio = float((times.size - 1) / (times[-1] - times[0])), 2 * energy / (k * gap**2)

    def frequency(term: float) -> float:
        away = 2 * math.acos(-1 / math.sqrt(ratio)) / math.sqrt(k)
        return 1 / (away + 2 * math.acos(math.sqrt(k / ((k + spring) * ratio - term))) / math.sqrt(k + spring))

    between = "read between points of their branch; their file calls its tolerance unexplained"
    left_out = "theirs leaves out a term: see the row with it"
    yield "frequency, their closed form", "Hz", frequency(0.0), computed, 6.5e-4, left_out
    yield "frequency, their closed form with the term", "Hz", frequency(spring), computed, 1e-12, "rounding"
    yield "frequency, their harmonic balance", "Hz", 0.64669392749957, computed, 1e-4, between


# ---- bars and masses that meet a rigid floor, and a rig ------------------------------------------


def _bar(elements: int, element: float, lumped: float, axial: float, mass: float, gap: float, pull: float) -> System:
    """A free bar of linear elements of a length (m) over a floor; EA in N, mass in kg/m, pull in m/s^2.

    Its mass matrix is the consistent one, and the lumped one by a share.
    """
    node = np.eye(elements + 1)
    stretch = node[1:] - node[:-1]
    coupling = stretch.T @ stretch
    M = mass * element * (np.diag(np.diag(coupling)) / 2 - (1 - lumped) * coupling / 6)
    K, load = axial / element * coupling, -pull * M.sum(axis=1)
    floor = Stop("floor", "bottom", (INF, gap), Rigid(0.0))
    return System.from_matrices(M, 0 * M, K, points={"bottom": node[0]}, stops=[floor], constant_load=load)


def bouncing_bar() -> Iterator[Row]:
    """A bar of 10 m dropped from 5 m: it touches for 2 L/c, flies, and touches again until its waves cancel."""
    for elements, lumped, bounds, off in (
        *((20, 0.5, (9e-3, 1e-2, 4e-3), 0.31), (100, 0.5, (2.5e-3, 2.1e-3, 6e-4), 0.09)),
        *((20, 1.0, (), 0.6), (100, 1.0, (), 0.18), (300, 1.0, (), 0.08), (20, 0.0, (), 0.7), (100, 0.0, (), 0.29)),
    ):
        system = reduce(_bar(elements, 10 / elements, lumped, 900.0, 1.0, 5.0, 10.0), elements + 1)
        run = integrate(system, Rest(), EventDriven(), 16 / 3, Recorder(("bottom",), interval=1 / 3))
        begin, end = run.sticking.start, run.sticking.end
        mesh = f"{elements} elements, {100 * lumped:g} % lumped"
        if bounds:
            yield f"first contact begins, {mesh}", "s", 1.0, float(begin[0]), 1e-12, "rounding"
            yield f"first contact ends, {mesh}", "s", 5 / 3, float(end[0]), bounds[0], MESH
            yield f"second contact begins, {mesh}", "s", 11 / 3, float(begin[1]), bounds[1], MESH
            yield f"second contact ends, {mesh}", "s", 13 / 3, float(end[1]), bounds[2], MESH
        yield f"displacement at 16/3 s, {mesh}", "m", 0.0, float(run["bottom"][-1]), off, MESH


def siconos_bar() -> Iterator[Row]:
    """A bar of 99 elements that meets a floor at 0.1 m/s: its impulse, and for how long it touches."""
    area = 0.000314
    system = _bar(99, 0.01, 0.0, 210e9 * area, 7800 * area, 5e-5, 0.0)
    stepping, falling = MoreauJean(2e-6, allow_coarse_step=True), State(np.zeros(100), np.full(100, -0.1))
    impacts = integrate(system, Rest(), stepping, 1e-3, Recorder(()), falling).impacts
    impulse, duration, same = impacts.impulse.sum(), impacts.duration.sum(), "the same rule, mesh and step: rounding"
    yield "impulse, Moreau-Jean, 2 us", "N s", 0.481427422067891, float(impulse), 1e-12, same
    yield "duration, Moreau-Jean, 2 us", "s", 3.82e-4, float(duration), 1e-12, same


def siconos_masses() -> Iterator[Row]:
    """A ball dropped from 1 m, and a mass of 1 g on a spring of 100 N/m let go at 1 m, both with e = 0.9."""
    below, here = (Stop("floor", "tip", (INF, gap), Rigid(0.9)) for gap in (1.0, 0.0))
    ball = _impacts(_with_stop(1.0, 0.0, 0.0, below, -GRAVITY), 8.5)
    mass = _impacts(_with_stop(1e-3, 0.0, 100.0, here, -1e-3 * GRAVITY), 0.5, displacement=1.0)
    tolerance = "both event-driven: tolerance of theirs"
    for what, count, impacts, time, speed in (
        ("ball", 24, ball, 7.858620482597298, 0.3533212254519507),
        ("mass on a spring", 50, mass, 0.4906846902365521, 1.629926692640904),
    ):
        rebound = float(impacts.rebound_speed[count - 1])
        yield f"time of impact {count}, {what}", "s", time, float(impacts.time[count - 1]), 5e-12, tolerance
        yield f"rebound speed of impact {count}, {what}", "m/s", speed, rebound, 5e-12, tolerance


def exudyn_spheres() -> Iterator[Row]:
    """Restitution of spheres of 1.6 kg that meet at 10 m/s, in steps of 10 or 20 us.

    A loss factor d gives the same restitution with every exponent, that of Hunt and Crossley being 3 (1 - e)/2.
    """
    # their d of Gonthier et al. and of Carvalho and Martins for e = 0.5 is 3/2 of what is taken from 1 here
    as_hunt = 1 - (1 - 0.5) * (11 - 0.5) / (1 + 9 * 0.5)
    step, gonthier = "their step", "Gonthier/Carvalho-Martins, e = 0.5"
    for law, restitution, steps, theirs, bound, reason in (
        ("Hunt-Crossley, e = 0.9", 0.9, 20, 0.9090298887177969, 1.6e-5, step),
        ("Hunt-Crossley, e = 0.5", 0.5, 20, 0.6629838391096419, 3.4e-5, step),
        ("Hunt-Crossley, e = 0.1", 0.1, 20, 0.5158573889338283, 5e-5, step),
        (gonthier, as_hunt, 20, 0.5001975126052718, 5e-5, f"{step}; their loss factor is an approximation"),
        (gonthier, as_hunt, 10, 0.5001784818335925, 1e-5, f"{step}; their loss factor is an approximation"),
    ):
        ours = collide(HuntCrossley(1e6, restitution), 1.6, 10.0).restitution
        yield f"restitution, {law}, {steps} us", "1", theirs, ours, bound, reason


def bouncing_ball_map() -> Iterator[Row]:
    """A ball on a vibrating table, e = 0.5: between which amplitudes it bounces once a cycle.

    The map is phi1 = phi + v, v1 = e v - c cos(phi1), c = 2 (1 + e) w^2 A/g. Its fixed point v = 2 pi,
    cos(phi) = -2 pi (1 - e)/c begins at c = 2 pi (1 - e) and doubles its period where c sin(phi) = -2 (1 + e).
    """
    e, unit_amplitude = 0.5, GRAVITY / (math.tau * FREQUENCY) ** 2
    run = bouncing(e, 1.0, 20)
    orbit = find_orbit(run.system, run.base, guess=run)
    branch = continue_orbit(orbit, "amplitude", (0.9 * unit_amplitude, 1.8 * unit_amplitude))
    fold = math.pi * (1 - e) / (1 + e)
    still, moving = math.hypot(fold, 1.0), math.hypot(fold, 2 * (1 + e**2) / (1 + e) ** 2)
    doubling = nearest_bifurcation(branch, "period-doubling", unit_amplitude * moving)
    the_map = "the map takes the table for still: see the row where it moves"
    at_fold = unit_amplitude * fold
    yield "amplitude at the fold", "m", at_fold, nearest_bifurcation(branch, "fold", at_fold), 1e-10, LOCATED
    yield "amplitude at the period doubling, table moving", "m", unit_amplitude * moving, doubling, 1e-10, LOCATED
    yield "amplitude at the period doubling", "m", unit_amplitude * still, doubling, 5.5e-2, the_map


def rig_of_two_beams() -> Iterator[Row]:
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
    frequencies = solve_modes(assemble(structure, elements=40), count=4).natural_frequency.tolist()
    reason = "bolts: the stiffness under the plate is set by trial; their model is this one"
    rig = ((30.95, 2e-4), (199.04, 1.6e-2), (556.82, 7e-3), (1085.93, 4.5e-3))
    for mode, ((theirs, bound), ours) in enumerate(zip(rig, frequencies, strict=True), 1):
        yield f"frequency, mode {mode}", "Hz", theirs, ours, bound, reason


NLVIB, ASTER = "NLvib 1.3 (Krack and Gross, 2019)", "code_aster (EDF, 2021)"
DOYEN = "Doyen et al. (2011), exact, in NLstep (Krack and Gross, 2025)"
PROGRAMS: tuple[Callable[[], Iterator[Case]], ...] = (
    partial(_cases, nlvib_oscillator, "NLvib, oscillator before a spring", f"{NLVIB}, a run"),
    partial(_cases, nlvib_two_masses, "NLvib, two masses", f"{NLVIB}, example 03; in Octave by Jurai (2026)"),
    partial(_cases, coco, "COCO, impact oscillator", "COCO (Schilder et al., 2020), example 15.2"),
    partial(_cases, aster_released_mass, "SDND101, released mass", f"{ASTER}, sdnd101a.comm"),
    partial(_cases, aster_shaken_mass, "SDND102, shaken mass", f"{ASTER}, sdnd102a.comm"),
    partial(_cases, aster_beam, "SDNL104, beam between springs", f"{ASTER}, sdnl104d.comm"),
    partial(_cases, aster_nonlinear_mode, "SDND122, nonlinear mode", f"{ASTER}, sdnd122a.comm"),
    partial(_cases, bouncing_bar, "bouncing bar", DOYEN),
    partial(_cases, siconos_bar, "Siconos, bar on a floor", "Siconos (INRIA, 2024), ImpactingBar.ref"),
    partial(_cases, siconos_masses, "Siconos", "Siconos (INRIA, 2024), BouncingBallED.ref and LinearOscillatorED.ref"),
    partial(_cases, exudyn_spheres, "Exudyn, spheres", "Exudyn (Gerstmayr, 2025), contactSphereSphereTest.py"),
    partial(_cases, bouncing_ball_map, "ball on a vibrating table", "derived here: map of Holmes (1982); momentum"),
    partial(
        _cases, rig_of_two_beams, "rig of two colliding beams, the left one", "Woiwode and Krack (2024), in NLtest"
    ),
)
"""Functions that run cases, each those of one source."""
