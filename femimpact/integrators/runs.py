"""Runs: one system under one excitation, many cases at once, one collision."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast, overload

import numpy as np

from femimpact.arrays import Array
from femimpact.errors import changed, checked, in_range, kind_of, made, quantity, require, require_type, warns
from femimpact.excitation.drives import alone, until
from femimpact.excitation.excitation import Excitation, has_cycle, require_excitation
from femimpact.excitation.remarks import motion_notes
from femimpact.integrators.assembly import MethodRun
from femimpact.integrators.cases import AchievedRestitution, run_each, workers_of
from femimpact.integrators.channel_rows import drive_of, mode_notes
from femimpact.integrators.methods import Method, require_method
from femimpact.integrators.planned_drive import drive_warnings, plan_notes
from femimpact.progress import Progress, check_progress, draws_progress
from femimpact.response.channels import Channel, motion_of, resolve_channels
from femimpact.response.cycles import Largest, LargestSample, LargestValues, deflection_warnings
from femimpact.response.history import HistoryPiece
from femimpact.response.impacts import READINGS_IN_CONTACT, impact_statistics, observed_restitution
from femimpact.response.response import Recorder, Response
from femimpact.system.contact_pair import ContactPair
from femimpact.system.matrices import rigid_motions
from femimpact.system.reduction import truncation_notes
from femimpact.system.state import ROUNDED, State, begun_anew
from femimpact.system.system import System
from femimpact.units import quantity_text

RESTITUTION_MISSED = 0.1
"""Difference between a law's restitution and the median seen in a run that is warned of."""

OTHER_END = 1e-3
"""Share of its length by which a run may end elsewhere than was asked for, without a word."""


@overload
def integrate(
    system: System,
    excitation: Excitation | None,
    method: Method,
    duration: float,
    record: Recorder | None = None,
    initial: State | None = None,
    progress: Progress | bool | None = None,
    *,
    threads: int | None = None,
) -> Response: ...


@overload
def integrate(
    system: System,
    excitation: Sequence[Excitation | None],
    method: Method,
    duration: float,
    record: Recorder | None = None,
    initial: State | None = None,
    progress: Progress | bool | None = None,
    *,
    threads: int | None = None,
) -> tuple[Response, ...]: ...


@warns
@draws_progress
def integrate(
    system: System,
    excitation: Excitation | Sequence[Excitation | None] | None,
    method: Method,
    duration: float,
    record: Recorder | None = None,
    initial: State | None = None,
    progress: Progress | bool | None = None,
    *,
    threads: int | None = None,
) -> Response | tuple[Response, ...]:
    """Motion of structure and balls under a moving base or a force, from an initial state.

    M u'' + C u' + K u = f - M r ub'' + b F(t) + sum_j b_j F_j,  m_j (y_j'' + ub'') = m_j g_j - F_j

    Parameters
    ----------
    system : System
        Physical or reduced.
    excitation : Sine, PointForce, Rest or another `Excitation`, or a sequence of them
        Each of a sequence has a separate run. None is `Rest()`: nothing drives the structure.
    method : Newmark, HHT, WBZ, GeneralizedAlpha, MoreauJean or EventDriven
        Or any other with the members of `methods.Method`.
    duration : float, s
        Rounded to a whole number of steps or of samples.
    record : Recorder, optional
        What to keep of each run; by default the tip, the balls and the contact forces at every
        step. Its memory limit holds for one run.
    initial : State, optional
        At rest in the frame of the base at t = 0 by default. The `final_state` of a response goes on from its end.
    progress : callable or bool, optional
        Called with the share done, 0 to 1; True draws a bar.
    threads : int, optional
        The runs of a sequence are spread over so many, by default as many as there are cores;
        the results do not depend on it, to the last bit.

    Returns
    -------
    Response, or a tuple of one for each excitation
        Displacements relative to the base, m; contact force on the structure, N.

    Raises
    ------
    InputError
        If the step does not resolve the contact, or the run would keep too much.
    DivergenceError
        If the motion is not finite or grows without bound; of several runs, the first that does.
    """
    recorder = Recorder() if record is None else record
    start = State() if initial is None else initial
    parts: tuple[tuple[str, Any, Any], ...] = (
        ("system", system, System), ("record", recorder, Recorder), ("initial", start, State)
    )  # fmt: skip
    for key, value, kind in parts:
        require_type(value, kind, key)
    require_method(method)
    share_done = check_progress(progress)
    workers = workers_of(threads)
    several = isinstance(excitation, Sequence) and not isinstance(excitation, (str, bytes))
    drives = _checked_drives(cast(Sequence[Any], excitation) if several else (excitation,))
    alone = recorder.sink is None or len(drives) == 1
    require(alone, "record.sink", None, "", "must serve one run: pieces of several could not be distinguished")

    def run(drive: Excitation, report: Progress | None) -> Response:
        # another duration is refused by the method
        if in_range(duration, quantity("s", above=0.0)):
            drive = until(drive, start.time + duration + 0.5 * (recorder.interval or 0.0))
        response = _without_cycles(response_by(method, system, drive, duration, recorder, start, report))
        return _with_remarks(response, system, drive, recorder, start, start.time + duration)

    responses = run_each(run, drives, workers, share_done)
    return responses if several else responses[0]


def _checked_drives(excitations: Iterable[Any]) -> list[Any]:
    """The excitations, one or more, each checked before the next: of a long range none is made."""
    drives = list[Any]()
    for drive in map(alone, excitations):
        require_excitation(drive)
        drives.append(drive)
    require(len(drives) > 0, "excitation", None, "", "must be one or more")
    return drives


def _with_remarks(
    response: Response, system: System, drive: Excitation, recorder: Recorder, start: State,
    end: float,  # s: asked for
) -> Response:  # fmt: skip
    """The response with warnings and notes on its excitation, deflections, end, stops and start."""
    warnings = (
        *drive_warnings(system, drive, end, start),
        # what nothing holds may go far without being bent
        *deflection_warnings(
            _largest_deflections(response, recorder), system.length * (rigid_motions(system).shape[1] < 2)
        ),
        *_missed_restitutions(response),
    )
    notes = (
        *motion_notes(drive, system.length, end),
        *plan_notes(system, drive, end - start.time, start),
        *_other_end(response, end),
        *_stops_not_met(response),
        *_coarse_forces(response),
        *_begins_within(system, drive, start),
    )
    if not (warnings or notes):
        return response
    return changed(response, warnings=(*response.warnings, *warnings), notes=(*response.notes, *notes))


def _missed_restitutions(response: Response) -> Iterator[str]:
    """Where higher modes of the beam change the rebound that a law was made for."""
    for pair in response.system.contacts:
        if pair.parameters.is_rigid:
            continue
        statistics = response.statistics_of[pair.name]
        speed = statistics.mean_approach_speed if statistics.count else 0.0
        observed, exact = (
            observed_restitution(response.impacts, pair.name, speed),
            pair.parameters.restitution_at(speed),
        )
        if abs(observed - exact) > RESTITUTION_MISSED:
            yield (
                f"{pair.name}: impacts rebound with {observed:.3g} (median) where the law has {exact:.3g}: the law is "
                "made for the first mode's mass, and the beam's other modes take part; impacts.restitution has each"
            )


def _without_cycles(response: Response) -> Response:
    """The same with no impacts per cycle where the excitation has no cycle, and the rms of all of the last third."""
    if has_cycle(response.base):
        return response
    values = response.channels.get(response.system.default_place)
    if values is not None:
        last = values[response.time >= response.window[0]]
        response = changed(response, steady=changed(response.steady, rms=np.array([np.sqrt(np.mean(last**2))])))
    none = {name: changed(item, impacts_per_cycle=math.nan) for name, item in response.statistics_of.items()}
    return changed(response, statistics=changed(response.statistics, impacts_per_cycle=math.nan), statistics_of=none)


def _other_end(response: Response, asked: float) -> tuple[str, ...]:
    """A note on a run that ends, at a step or a reading, at another time (s) than was asked for."""
    end = asked if response.final_state is None else response.final_state.time
    if abs(end - asked) <= OTHER_END * (asked - response.start):
        return ()
    return (f"the run ends at {end:.6g} s, at a whole step or reading, and not at {asked:.6g} s",)


def _begins_within(system: System, drive: Excitation, start: State) -> tuple[str, ...]:
    """Notes on compliant walls that a start made by hand lies beyond: that may be a wrong unit."""
    if start.continuation is not None or start.is_static_on(system):
        return ()
    u, _, y, _ = start.relative_to_base(system, drive)
    notes = list[str]()
    for j, pair in enumerate(system.contacts):
        x = float(y[j] - pair.direction @ u)
        side, depth = ("+", x - pair.gaps[0]) if x > 0.0 else ("-", -x - pair.gaps[1])
        if depth > ROUNDED and not pair.parameters.is_rigid:
            notes.append(f"{pair.name} starts in contact, {depth:.3g} m beyond its {side} wall")
    return tuple(notes)


def _stops_not_met(response: Response) -> list[str]:
    """Notes on stops with two different gaps that a run has not met: these may be given in the wrong order."""
    notes = list[str]()
    for pair in response.system.contacts:
        plus, minus = pair.gaps
        if pair.kind != "stop" or plus == minus or min(plus, minus) < 0.0 or response.impacts.dropped:
            continue
        met = pair.name in response.impacts.impactor or pair.name in response.sticking.impactor
        # a compliant contact that lasts has no row yet
        if met or response.statistics_of[pair.name].peak_force > 0.0:
            continue
        walls = [f"{gap:.4g} m to the {side} side" for gap, side in ((plus, "+"), (minus, "-")) if gap < math.inf]
        notes.append(
            f"{pair.name} is not met: its gap is {' and '.join(walls)}; a gap is (to the + side, to the - side)"
        )
    return notes


def _coarse_forces(response: Response) -> Iterator[str]:
    """Notes on contact forces that are read more seldom than ten times in a compliant contact."""
    impacts, contacts = response.impacts, response.system.contacts
    if response.time.size < 2:
        return
    interval = float(response.time[1] - response.time[0])
    for pair in contacts:
        of_pair = (impacts.impactor == pair.name) & (impacts.duration > 0.0)
        lasting = float(np.median(impacts.duration[of_pair])) if of_pair.any() else math.inf
        names = [f"{pair.name}.contact_force", *(["contact_force"] if len(contacts) == 1 else [])]
        for name in names:
            if name in response.channels and READINGS_IN_CONTACT * interval > (1.0 + 1e-9) * lasting:
                yield (
                    f"{name} is read every {quantity_text(interval, 's', 3)}, and a contact lasts "
                    f"{quantity_text(lasting, 's', 3)}: fewer than {READINGS_IN_CONTACT} readings in it miss its peak; "
                    "impacts.peak_force has that of each, and a smaller every, or Recorder(interval=) of EventDriven, "
                    "shows it"
                )


def _largest_deflections(response: Response, recorder: Recorder) -> list[float]:
    """Largest |w| (m): of the default place over the last third of the run, of recorded places over all of the run."""
    system, deflections = response.system, [float(response.steady.peak[0])]
    balls = [pair.name for pair in system.contacts]
    for channel in resolve_channels(system, recorder.channels):
        # of a streamed run there are none
        values = response.channels.get(channel.name)
        if values is not None and motion_of(channel) == (0, False) and channel.name not in balls:
            deflections.append(max(values.max(initial=0.0), -values.min(initial=0.0)))
    return deflections


def checked_run(
    method: Method,
    system: System,
    excitation: Excitation,
    duration: float,
    recorder: Recorder,
    initial: State,
    progress: Progress | None = None,
) -> MethodRun:
    """A run on a system and under a drive that the method takes, with all its warnings."""
    warnings = method.check(system)
    # of a user's excitation it is not checked before
    frequency = checked("excitation.frequency", excitation.frequency, quantity("Hz", above=0.0))
    method.check_drive(np.array([frequency]), "frequency")
    run = method.run(system, excitation, duration, recorder, initial, progress)
    dropped, recorded = run.impacts.dropped, len(run.impacts)
    lost = f"{dropped} impacts beyond the first {recorded} are not in the table (Recorder.impacts)"
    return replace(run, warnings=(*warnings, *run.warnings, *([lost] if dropped else [])))


def response_by(
    method: Method,
    system: System,
    excitation: Excitation,
    duration: float,
    recorder: Recorder,
    initial: State,
    progress: Progress | None = None,
) -> Response:
    """The response of one run, with what the method says of it and nothing on the excitation; see `integrate`."""
    run = checked_run(method, system, excitation, duration, recorder, initial, progress)
    history, frequency, contacts = run.history, excitation.frequency, system.contacts
    laws = ", ".join(dict.fromkeys(pair.law.name for pair in contacts)) or "none"
    again = partial(response_by, method, system, excitation, duration, initial=initial)
    return made(
        Response,
        time=history.time,
        channels=history.channels,
        units=history.units,
        impacts=run.impacts,
        sticking=run.sticking,
        statistics=impact_statistics(run.totals, run.measured, frequency, laws),
        statistics_of={
            pair.name: impact_statistics(run.totals[:, j : j + 1], run.measured, frequency, pair.law.name)
            for j, pair in enumerate(contacts)
        },
        steady=run.steady,
        energy=history.energy,
        snapshots=history.snapshots,
        base=history.base,
        system=system,
        warnings=run.warnings,
        notes=(
            *begun_anew(initial.continuation, run.going_on),
            *method.notes(system),
            *truncation_notes(system),
            *run.notes,
        ),
        streamed_to=run.streamed_to,
        start=initial.time,
        final_state=run.final_state,
        kept_state=run.kept_state,
        largest_values=run.largest
        or LargestValues(partial(_largest, again, recorder), partial(_reread, again, recorder)),
        events=run.events,
    )


PIECE = 10_000
"""Instants in memory at once where all of a run are gone through."""


def _at_every_instant(recorder: Recorder, channels: tuple[Channel, ...], **others: Any) -> Recorder:
    """A recorder of channels at all instants of a run, which has the same bits whatever is kept."""
    nothing_else: dict[str, Any] = {"snapshots": 0, "state_at": None, "impacts": 0, "events": 0, "ledger": False}
    return replace(recorder, channels=channels, every=1, memory_limit=1e30, **nothing_else, **others)


def _largest(
    again: Callable[[Recorder], Response], recorder: Recorder, channels: tuple[Channel, ...]
) -> tuple[Largest, ...]:
    """Largest values of channels over all instants at which a run is read."""
    largest = [LargestSample() for _ in channels]

    def take(piece: HistoryPiece) -> None:
        for one, channel in zip(largest, channels, strict=True):
            one.add(piece.channels[channel.name], piece.time)

    run = again(_at_every_instant(recorder, channels, start=0.0, sink=take, piece_samples=PIECE))
    drive = drive_of(run.system, run.base)
    return tuple(
        Largest(one.value, one.time or 0.0, channel.unit, mode_notes(run.system, drive, (channel,)))
        for one, channel in zip(largest, channels, strict=True)
    )


def _reread(
    again: Callable[[Recorder], Response], recorder: Recorder, channels: tuple[Channel, ...], start: float, _: float
) -> tuple[Array, dict[str, Array]]:
    """Times (s) and values of channels at all instants of a run from a time (s) on."""
    run = again(_at_every_instant(recorder, channels, start=start, sink=None))
    return run.time, dict(run.channels)


def achieved_restitution(
    pair: ContactPair, method: Method, approach_speed: float, phases: int = 32
) -> AchievedRestitution:
    """Restitution that a method achieves when the pair's effective mass collides with a wall, computed with its steps.

    Parameters
    ----------
    method : Newmark, HHT, WBZ, GeneralizedAlpha or MoreauJean
        One with a step that takes the pair's law.
    approach_speed : float, m/s
    phases : int
        At how many instants within a step the touch is tried.

    Raises
    ------
    InputError
        If the method has no step for the pair's law.
    """
    allowed = "must be a ContactPair, one of those in system.contacts"
    require(isinstance(pair, ContactPair), "pair", kind_of(pair), "", allowed)
    approach_speed = checked("approach_speed", approach_speed, quantity("m/s", above=0.0))
    phases = checked("phases", phases, quantity("1", at_least=1, at_most=1_000_000, integer=True))
    require_method(method)
    restitution = method.achieved_restitution(pair, approach_speed, phases)
    if restitution is None:
        allowed = f"must be a method with a step for the law {pair.law.name}"
        require(False, "method", type(method).__name__, "", allowed)
        raise AssertionError("require raises")
    return restitution
