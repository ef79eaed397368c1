"""The drive of a system, and its channels as rows over displacements, velocities and the drive."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse.linalg
from numpy.typing import ArrayLike

from femimpact.arrays import Array, own
from femimpact.errors import real_array, require
from femimpact.excitation.drives import CONSTANT_FORCES, Drives
from femimpact.excitation.excitation import AT_SAMPLE, BrokenLine, Excitation, Harmonic, LineLoad, require_excitation
from femimpact.excitation.piecewise_polynomial import PiecewisePolynomial, pieces_of
from femimpact.excitation.sums import one_sine
from femimpact.response.channels import Channel, QuantityAt, Reading, is_of_contact, zero_reading
from femimpact.structure.structure import Position
from femimpact.system.modes import solve_stiffness
from femimpact.system.reduction import kept_modes
from femimpact.system.system import System
from femimpact.units import number_text, prefixed, quantity_text

JUMP = 1e-6
"""Share of the largest value of a history above which two pieces of it do not meet: those made of sines do to 1e-9."""


@dataclass(frozen=True, eq=False)
class Drive:
    """M u'' + C u' + K u = load s(t) + contacts, y'' = g - share s(t) + contacts."""

    load: Array  # (dofs,) -base_load (kg) where s is the base's acceleration, b (1) where it is a force
    share: float  # 1 where s is the base's acceleration, 0 where it is a force
    omega: float  # rad/s: of what counts as a cycle
    history: Callable[[Array], ArrayLike]  # s (m/s^2 or N) at times in s
    closed_form: Harmonic | BrokenLine | PiecewisePolynomial | None  # of s(t), where it has one
    at: Position | LineLoad | None = None  # place of a force; None where the base moves
    resultant: float = 1.0  # N per unit of s, of a force
    # of several drives at once: those along further loads, each a drive by itself; all drives, the base first, whose
    # work is kept apart, with the number of their load; and their names
    more: tuple[Drive, ...] = ()
    parts: tuple[Drive, ...] = ()
    own: tuple[Drive, ...] = ()  # these with the closed forms that each has alone
    members: tuple[Drive, ...] = ()  # those of them along this load
    names: tuple[str, ...] = ()
    place: int = 0

    @property
    def loads(self) -> tuple[Drive, ...]:
        """The drive and those along further loads."""
        return (self, *self.more)

    @property
    def rate(self) -> float | None:
        """Rate of change of the polynomials (1/s) that the drives are made of; None for sines."""
        return max((load.pieces.rate for load in self.loads if load.pieces is not None), default=None)

    @property
    def sine(self) -> Harmonic:
        """s(t) as a sine, with amplitude 0 where it is not one."""
        return self.closed_form if isinstance(self.closed_form, Harmonic) else Harmonic(0.0, self.omega, 0.0)

    @property
    def line(self) -> BrokenLine | None:
        """s(t) as a broken line, where it is one."""
        return self.closed_form if isinstance(self.closed_form, BrokenLine) else None

    @property
    def in_pieces(self) -> bool:
        """True if s(t) is made of polynomials between knots, straight lines among them."""
        return isinstance(self.closed_form, BrokenLine | PiecewisePolynomial)

    @cached_property
    def pieces(self) -> PiecewisePolynomial | None:
        """s(t) as polynomials between knots, where it is made of them or is a broken line."""
        form = self.closed_form
        return pieces_of(form) if isinstance(form, BrokenLine | PiecewisePolynomial) else None

    @property
    def is_sine(self) -> bool:
        """True if s(t) is a sine; the values of anything else are tabulated by methods that take steps."""
        return isinstance(self.closed_form, Harmonic)

    @property
    def is_tabulated(self) -> bool:
        """True where methods that take steps read values at their steps: of all but one sine."""
        return bool(self.parts) or not self.is_sine

    @property
    def base_amplitude(self) -> float:
        """Amplitude of the base's displacement under a sine, m."""
        return -self.share * self.sine.amplitude / self.omega**2

    def value(self, time: Array) -> Array:
        """s(t) at times in s."""
        if self.is_sine:
            wave = self.sine
            return np.asarray(wave.amplitude * np.sin(wave.omega * time + wave.phase))
        if self.line is not None and np.size(time):
            # of a long record the samples around the times alone
            h, most = self.line.interval, self.line.samples.size - 1
            first = min(max(int(np.min(time) / h) - 1, 0), most)
            last = min(max(int(np.max(time) / h) + 2, first), most)
            knots = h * np.arange(first, last + 1)
            return np.asarray(np.interp(time, knots, self.line.samples[first : last + 1], right=0.0))
        if self.pieces is not None:
            return self.pieces.value(time)
        allowed = f"must give {np.size(time)} finite numbers for as many times"
        values = real_array("excitation", self.history(time), "m/s^2 or N", allowed)
        require(values.shape == np.shape(time), "excitation", f"array of shape {values.shape}", "m/s^2 or N", allowed)
        return values

    def value_at_steps(self, time: Array) -> Array:
        """s(t) at the even times (s) of steps, with what keeps a method of order 2 at that order where s(t) jumps.

        Trapezoids between the steps miss a share of the impulse of a jump, up to half a step of it. At the step nearest
        to a jump, the jumps of s(t) and of its slope count by the shares with which the two trapezoids beside that step
        have their impulses. What does not jump there is read as it is, so that the values of a sum are the sums of
        those of its parts. So is a history without a closed form.
        """
        values, h = self.value(time), float(time[1] - time[0])
        read = values.copy()
        for jump, left, size, bend in self._jumps:
            # steps to the first one are read as the run has begun there
            i = max(round((jump - time[0]) / h), 1)
            if jump > time[0] and i < time.size:
                after = time[i] - jump
                # at the jump itself rounding decides on which side the history is read
                beyond = after > 0.0 if abs(after) > AT_SAMPLE * h else abs(read[i] - left) > 0.5 * abs(size)
                values[i] += size * (after / h + 0.5 - beyond)
                values[i] += bend * (0.5 * after * (1.0 + after / h) - max(after, 0.0))
        return values

    @cached_property
    def _jumps(self) -> Array:
        """Times (s) at which s(t) jumps in a closed form, its values before, its changes and its slope's: (n, 4)."""
        if self.line is not None:
            samples, h = self.line.samples, self.line.interval
            last, largest = float(samples[-1]), float(np.abs(samples).max())
            jumps = np.array([[h * (samples.size - 1), last, -last, (samples[-2] - last) / h]])
        elif self.pieces is not None:
            h, table, c = np.diff(self.pieces.knots), self.pieces.table, self.pieces.coefficients
            before = np.zeros((table.shape[0], 2))
            for n in range(self.pieces.degree, -1, -1):
                before[1:, 1] = before[1:, 1] * h + before[1:, 0]
                before[1:, 0] = before[1:, 0] * h + c[:, n]
            jumps = np.column_stack([self.pieces.knots, before[:, 0], table[:, 2:4] - before])
            largest = float(np.abs(before[:, 0]).max())
        else:
            return np.zeros((0, 4))
        return np.asarray(jumps[np.abs(jumps[:, 2]) > JUMP * largest])


def drive_of(system: System, excitation: Excitation) -> Drive:
    """The right-hand side of an excitation on a system."""
    require_excitation(excitation)
    if isinstance(excitation, Drives):
        return _several(system, excitation)
    # the two members that a user's excitation may lack
    at, closed_form = (getattr(excitation, name, None) for name in ("at", "closed_form"))
    omega = 2.0 * np.pi * excitation.frequency
    if at is None:
        return Drive(-system.base_load, 1.0, omega, excitation.acceleration, closed_form)
    force: Any = excitation
    resultant = system.resultant(at) if isinstance(at, LineLoad) else 1.0
    return Drive(system.point_row(at), 0.0, omega, force.force, closed_form, at, resultant)


def _several(system: System, excitation: Drives) -> Drive:
    """The right-hand side of several drives: those along one load are one history."""
    drives = [drive_of(system, drive) for drive in excitation.drives]
    if len(drives) == 1:
        return drives[0]
    forms = excitation.closed_forms or [None] * len(drives)
    places = list(dict.fromkeys((part.share, part.load.tobytes()) for part in drives))
    parts = [
        replace(part, closed_form=form, place=places.index((part.share, part.load.tobytes())))
        for part, form in zip(drives, forms, strict=True)
    ]
    of_loads = [[part for part in parts if part.place == number] for number in range(len(places))]
    omega = 2.0 * np.pi * excitation.frequency
    own = tuple(replace(part, place=other.place) for part, other in zip(drives, parts, strict=True))
    first, *more = [
        replace(_along_one_load(members), omega=omega, members=tuple(part for part in own if part.place == number))
        for number, members in enumerate(of_loads)
    ]
    return replace(first, more=tuple(more), parts=tuple(parts), names=excitation.names, own=own)


def _along_one_load(parts: Sequence[Drive]) -> Drive:
    """Drives along one load as one."""
    if len(parts) == 1:
        return parts[0]
    forms = [part.closed_form for part in parts]
    form: Any = one_sine(forms)
    pieces = [motion for motion in forms if isinstance(motion, PiecewisePolynomial)]
    if len(pieces) == len(forms):
        form = PiecewisePolynomial(pieces[0].knots, np.sum([motion.coefficients for motion in pieces], axis=0))
    return replace(parts[0], closed_form=form, history=lambda time: sum(part.value(time) for part in parts))


def named_work(drive: Drive, work: Array, system: System) -> dict[str, Array]:
    """Work (J) of each of several drives, and of constant forces where there are any: columns (samples, drives + 1)."""
    if not drive.parts:
        return {}
    constant = np.any(system.constant_load) or any(pair.acceleration != 0.0 for pair in system.balls)
    names = (*drive.names, *((CONSTANT_FORCES,) if constant else ()))
    # copies: the arrays of a run with a sink are filled again
    return {name: own(work[:, i]) for i, name in enumerate(names)}


NEGLIGIBLE = 1e-9
"""Share of the mass below which what is left out is rounding."""


@dataclass(frozen=True, eq=False)
class ChannelRows:
    """R channels of a system with n dofs and B pairs under a drive s(t), free of accelerations; of one no axis R."""

    displacement: Array  # (R, n) of u and u'
    velocity: Array  # (R, n)
    ball_displacement: Array  # (R, B) of y and y'; zero for stops
    ball_velocity: Array  # (R, B)
    contact_force: Array  # (R, B) of the forces of contact on the structure along b_j
    pair_force: Array  # (R, B) of the same with those of springs and dashpots; zero where the loop holds these apart
    base: Array  # (R, 3) of ub, ub' and ub''
    drive: Array  # (R, H) of s(t) of each load
    constant: Array  # (R,)

    def of_time(self, channel: int, time: Array, excitation: Excitation, drive: Drive) -> Array | float:
        """The part of a channel that the state has no share in, at times in s: base, drive and constant."""
        total: Array | float = float(self.constant[channel])
        motions = (excitation.displacement, excitation.velocity, excitation.acceleration)
        for weight, motion in zip(self.base[channel], motions, strict=True):
            if weight != 0.0:
                total = total + weight * motion(time)
        for weight, load in zip(self.drive[channel], drive.loads, strict=True):
            if weight != 0.0:
                total = total + weight * load.value(time)
        return total


def channel_rows(
    system: System,
    drive: Drive,
    channels: tuple[Channel, ...],
    *,
    # whether the time loop holds no forces of pairs with those of their centring springs and dashpots in them
    springs_apart: bool,
) -> ChannelRows:
    """Rows of channels; the accelerations are M^-1 (load s + constant load - C u' - K u + sum_j b_j F_j) and so on."""
    rows = [_row(system, drive, channel.reading(system), springs_apart) for channel in channels]
    # of no channels, arrays without rows
    all_rows = rows or [_row(system, drive, zero_reading(system), springs_apart)]
    names = [item.name for item in fields(ChannelRows)]
    columns = (np.array([getattr(row, name) for row in all_rows], dtype=float) for name in names)
    return ChannelRows(*(column[: len(rows)] for column in columns))


def mode_notes(system: System, drive: Drive, channels: Sequence[Channel]) -> tuple[str, ...]:
    """Notes on channels where modes are left out: how far what they read of those that are kept is from all of it."""
    return (*_reaction_notes(system, drive, channels), *_static_notes(system, drive, channels))


def _reaction_notes(system: System, drive: Drive, channels: Sequence[Channel]) -> tuple[str, ...]:
    """A note on reactions: by how much they differ from the shaker's force.

    Both are linear in the motion; only the coefficients of the drives and of contact forces, and the constant forces,
    differ.
    """
    if not any(np.any(channel.reading(system).reaction) for channel in channels):
        return ()
    weights = np.array([float(item.unit == "N") for item in system.reactions.values()])
    readings = replace(zero_reading(system), reaction=weights), QuantityAt("shaker_force").reading(system)
    parts, rows = [], [_row(system, drive, each, springs_apart=False) for each in readings]
    for h, load in enumerate(drive.loads):
        driven = [row.base[2] * load.share + row.drive[h] for row in rows]
        by_drive, moved = abs(driven[0] - driven[1]), load.share > 0.0
        if by_drive > NEGLIGIBLE * (system.total_mass if moved else 1.0):
            share = number_text(by_drive / (abs(load.resultant) or 1.0), 3)
            of_force = f"{share} of the force" + (f" at {load.at}" if drive.more else "")
            parts.append(f"{number_text(by_drive, 3)} kg times the base's acceleration" if moved else of_force)
    at_rest = abs(float(rows[0].constant - rows[1].constant))
    if at_rest > NEGLIGIBLE * abs(float(rows[1].constant)):
        parts.append(f"{number_text(at_rest, 3)} N of gravity and other constant forces")
    if not parts:
        return ()
    return (
        f"modes are left out: reactions, read from those that are kept, differ from the sum of inertia forces by "
        f"{', by '.join(parts)}, and by what contacts excite in the others; all that moves with the base has "
        f"{number_text(system.total_mass, 3)} kg",
    )


NAMED = 1e-3
"""Share of a static value that modes which are left out must have to be named."""


def _static_notes(system: System, drive: Drive, channels: Sequence[Channel]) -> tuple[str, ...]:
    """Notes on what is read of displacements: values at rest of the modes kept, and of all, under each of the loads.

    Where the loads change slowly beside the modes left out, these add the difference to every reading.
    """
    full = system.unreduced
    # of matrices of another program the static state may take longer than the run
    if full is None or full.sections is None:
        return ()
    # the flexibility at contacts has a note by itself
    others = [each for each in channels if not is_of_contact(each)]
    rows = [(channel, row) for channel in others if np.any(row := channel.reading(system).displacement)]
    if not rows:
        return ()
    words, of_whole, of_kept = zip(*_static_loads(system, full, drive), strict=True)
    deflection, stiffness, notes = solve_stiffness(full, np.column_stack(of_whole)), system.K.diagonal(), list[str]()
    # a rigid motion that is free has no static value
    flexible = np.divide(1.0, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0.0)
    for channel, row in rows:
        terms = row * flexible * np.array(of_kept)
        reduced, all_of_it = terms.sum(axis=1), channel.reading(full).displacement @ deflection
        error = np.abs(reduced - all_of_it)
        named = (error > NAMED * np.abs(all_of_it)) & (error > NEGLIGIBLE * np.abs(terms).sum(axis=1))
        factors = [prefixed(abs(value), channel.unit)[0] for value in all_of_it]
        parts = [
            f"{number_text(factors[i] * reduced[i], 5)} of the structure's "
            f"{quantity_text(all_of_it[i], channel.unit, 5)} under {words[i]}"
            for i in np.flatnonzero(named)
        ]
        if parts:
            notes.append(
                f"{channel.name}: {kept_modes(system.dofs)} kept, with a static value of {', of '.join(parts)}: what "
                "changes slowly lacks the difference; keep more"
            )
    return tuple(notes)


def _static_loads(system: System, full: System, drive: Drive) -> Iterator[tuple[str, Array, Array]]:
    """Words for each load, and the load (N) on the dofs of the whole structure and on the modes that are kept."""
    for load in drive.loads:
        if load.at is None:
            yield "1 m/s^2 of the base", -full.base_load, load.load
        else:
            words = "the line force" if isinstance(load.at, LineLoad) else f"1 N at {load.at}"
            yield words, full.point_row(load.at), load.load
    # a constant load that was replaced is that of the modes alone
    if np.any(system.constant_load) and system.constant_resultant == full.constant_resultant:
        yield "constant forces", np.asarray(full.constant_load), np.asarray(system.constant_load)
    directions = {pair.name: pair.direction for pair in full.contacts}
    for pair in system.contacts:
        if pair.name in directions:
            yield f"1 N of {pair.name}", directions[pair.name], pair.direction


def _free_of_reactions(system: System, drive: Drive, reading: Reading) -> tuple[Reading, Array]:
    """The same reading with reactions written by what they are read from: held rows, less the forces on held dofs.

    Beside it, what it reads of the force of each load, (H,).
    """
    numbers = np.flatnonzero(reading.reaction)
    point_force = reading.point_force * np.array([load.resultant for load in drive.loads])
    if numbers.size == 0:
        return reading, point_force
    items = list(system.reactions.values())
    applied = [np.zeros(len(items)) if load.at is None else system.held_shares(load.at) for load in drive.loads]
    for i in numbers:
        item, weight = items[i], reading.reaction[i]
        contact = weight * system.contact_shares[i]
        springs, dashpots = (
            contact * [getattr(pair, name) for pair in system.contacts] for name in ("free_stiffness", "free_damping")
        )
        directions = np.array([pair.direction for pair in system.contacts]).reshape(-1, system.dofs)
        on_u, on_v = (np.sum(each[:, None] * directions, axis=0) for each in (springs, dashpots))
        point_force -= [weight * shares[i] for shares in applied]
        reading = replace(
            reading,
            displacement=reading.displacement + weight * item.on_displacement + on_u,
            velocity=reading.velocity + weight * item.on_velocity + on_v,
            acceleration=reading.acceleration + weight * item.on_acceleration,
            ball_displacement=reading.ball_displacement - springs,
            ball_velocity=reading.ball_velocity - dashpots,
            base=reading.base + np.array([0.0, 0.0, weight * item.on_base_acceleration]),
            contact_force=reading.contact_force - contact,
            constant=reading.constant - weight * item.constant,
        )
    return reading, point_force


def _row(system: System, drive: Drive, reading: Reading, springs_apart: bool) -> ChannelRows:
    """The row of a reading."""
    reading, point_force = _free_of_reactions(system, drive, reading)
    displacement, velocity = reading.displacement.copy(), reading.velocity.copy()
    balls = np.array([not pair.is_stop for pair in system.contacts], dtype=bool)
    y, y_rate = reading.ball_displacement * balls, reading.ball_velocity * balls
    shares = np.array([load.share for load in drive.loads])
    driven, constant = point_force * (1.0 - shares), reading.constant
    # accelerations read, by the force of each pair on structure and ball
    per_force = np.zeros(len(system.contacts))
    if np.any(reading.acceleration):
        z = np.atleast_1d(scipy.sparse.linalg.spsolve(system.M.tocsc(), reading.acceleration))
        displacement -= system.K.T @ z
        velocity -= system.C.T @ z
        driven += [float(load.load @ z) for load in drive.loads]
        constant += float(np.asarray(system.constant_load) @ z)
        per_force += [float(pair.direction @ z) for pair in system.contacts]
    for j, pair in enumerate(system.contacts):
        if pair.is_stop:
            continue
        weight = reading.ball_acceleration[j]
        per_force[j] -= weight * pair.mobility
        driven -= weight * shares
        constant += weight * pair.acceleration
        if springs_apart:
            spring = pair.free_stiffness * per_force[j]
            y[j] += spring
            displacement -= spring * pair.direction
            dashpot = pair.free_damping * per_force[j]
            y_rate[j] += dashpot
            velocity -= dashpot * pair.direction
    for j, (first, second) in system.meetings.items():
        per_force[j] = per_force[first] - per_force[second]
    contact, pairs = reading.contact_force, per_force
    if springs_apart:
        contact, pairs = contact + per_force, 0.0 * per_force
    return ChannelRows(displacement, velocity, y, y_rate, contact, pairs, reading.base, driven, np.array(constant))
