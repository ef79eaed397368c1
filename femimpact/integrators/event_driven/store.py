"""The closed forms that a call has needed, in arrays for the compiled loop: each is made when it is first needed."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from femimpact import core
from femimpact.arrays import Array
from femimpact.core.structs import zeros
from femimpact.excitation.piecewise_polynomial import ORDERS
from femimpact.integrators.channel_rows import ChannelRows, Drive
from femimpact.integrators.event_driven.closed_form import (
    OF_DISPLACEMENT,
    ClosedForms,
    Rows,
    by_load,
    closed_forms,
    driven_entries,
    followed,
    from_rows,
    gap_rows,
    settled,
)
from femimpact.integrators.event_driven.complex_modes import part_of, stack
from femimpact.integrators.event_driven.equations import Equations, equations_of, stacked
from femimpact.system.system import System

MOST_NUMBERS = 2**21
"""Complex numbers of a working array, 32 MB, beyond which fewer forms are made together."""

MOST_KEPT = 256
"""Closed forms, and what else is derived of a system, beyond which no more are kept with it."""


class WantedForm(NamedTuple):
    """A closed form by its pairs in contact, its contact parameters and the number of its system."""

    key: int  # bit j is set where pair j is in contact
    parameters: bytes  # equal for the forms of one system with equal contact parameters
    numbers: Array  # (2 pairs,) stiffness (N/m) and damping (N s/m)
    system: int


@dataclass(frozen=True, eq=False)
class Outputs:
    """Scalars read at every sample: rows of coordinates p, of rates p' and of the forces of pairs in contact."""

    position: Array  # (O, d)
    rate: Array  # (O, d)
    force: Array  # (O, pairs)
    drive: Array  # (3H, O) of s, ub' and ub of each load
    constant: Array  # (O,)


def outputs_of(
    system: System,
    observed: Array,  # (dofs,)
    rows: ChannelRows | None = None,
) -> Outputs:
    """Rows of the observed place, then those of the channels."""
    count, loads = (0, 1) if rows is None else rows.drive.shape
    n, balls = system.dofs, len(system.balls)
    position, rate = (np.zeros((1 + count, n + balls)) for _ in range(2))
    force = np.zeros((1 + count, len(system.contacts)))
    position[0, :n] = observed
    if rows is not None:
        position[1:, :n], position[1:, n:] = rows.displacement, rows.ball_displacement[:, :balls]
        rate[1:, :n], rate[1:, n:] = rows.velocity, rows.ball_velocity[:, :balls]
        force[1:] = rows.contact_force
    return Outputs(position, rate, force, np.zeros((3 * loads, 1 + count)), np.zeros(1 + count))


def outputs_alone(system: System, rows: ChannelRows, drive: Drive) -> Outputs:
    """The row of a channel as that of the observed place, with what it reads of the base, the drive and constants."""
    all_rows = outputs_of(system, np.zeros(system.dofs), rows)
    # of a force the base stands still
    of_base = np.zeros((3 * rows.drive.shape[1], 1))
    of_base[:3] = drive.share * rows.base[:1, ::-1].T
    of_base[::3] += rows.drive[:1].T
    return Outputs(all_rows.position[1:], all_rows.rate[1:], all_rows.force[1:], of_base, rows.constant[:1])


class FormStore:
    """Closed forms of some systems of as many coordinates, pairs and outputs; threads may share them."""

    def __init__(
        self,
        systems: Sequence[System],
        drives: Sequence[Drive],  # of each
        outputs: Sequence[Outputs],
    ) -> None:
        self.systems, self.outputs = systems, outputs
        self.equations = [equations_of(*each) for each in zip(systems, drives, strict=True)]
        self.rate = drives[0].rate
        self.lock = threading.Lock()
        self.known: dict[tuple[bytes, int], int] = {}
        self.last: dict[bytes, tuple[int, int]] = {}
        self.first: dict[bytes, int] = {}
        self.count = 0
        # entries, rigid-body coordinates and blocks of the largest form: with one entry a coordinate nothing must grow
        self.most = (self.equations[0].M.shape[0], 1, 1)
        self.forms = self._empty(4)

    def first_forms(self, wanted: Sequence[WantedForm]) -> list[int]:
        """First form of each system and its contact parameters, after all wanted forms are there.

        Those that are missing are made together where the same pairs are in contact.
        """
        with self.lock:
            missing: dict[int, dict[bytes, WantedForm]] = {}
            for item in wanted:
                if (item.parameters, item.key) not in self.known:
                    missing.setdefault(item.key, {})[item.parameters] = item
            # a system's entries may need as many matrices as it has coordinates, each of their size
            most = max(MOST_NUMBERS // self.equations[0].M.shape[0] ** 3, 1)
            for key, items in missing.items():
                together = list(items.values())
                for begin in range(0, len(together), most):
                    self._make(key, together[begin : begin + most])
            return [self.first[item.parameters] for item in wanted]

    def _make(self, key: int, wanted: Sequence[WantedForm]) -> None:
        """Make forms of the same pairs in contact; those that earlier calls made are kept with their systems."""
        active = np.array([bool(key >> j & 1) for j in range(self.equations[0].rigid.size)], dtype=bool)
        groups, missing = list[tuple[list[WantedForm], Equations, ClosedForms]](), list[WantedForm]()
        for item in wanted:
            entry = self.systems[item.system].derived.get(self._kept_key(item, active))
            if entry is None:
                missing.append(item)
            else:
                forms, number = entry
                equations = stacked([self.equations[item.system]])
                groups.append(([item], equations, part_of(forms, np.array([number]))))
        if missing:
            equations = stacked([self.equations[item.system] for item in missing])
            stiffness, damping = np.split(np.array([item.numbers for item in missing]), 2, axis=1)
            for members, forms in closed_forms(equations, active, stiffness, damping):
                items = [missing[f] for f in members]
                groups.append((items, part_of(equations, members), forms))
                for number, item in enumerate(items):
                    derived = self.systems[item.system].derived
                    if len(derived) < MOST_KEPT:
                        derived[self._kept_key(item, active)] = forms, number
        for items, equations, forms in groups:
            self._add(items, equations, forms, active)

    def _kept_key(self, item: WantedForm, active: NDArray[np.bool_]) -> tuple[Any, ...]:
        """Key of a closed form among what is kept with a system: also of the place where the drive acts."""
        equations = self.equations[item.system]
        of_drive = equations.drive.tobytes(), equations.in_space.tobytes()
        return "closed form", *of_drive, active.tobytes(), item.numbers.tobytes()

    def snapshot(self) -> core.events.Forms:
        """All forms known now."""
        with self.lock:
            return self.forms._replace(made=self.count)

    def _empty(self, capacity: int) -> core.events.Forms:
        (d, pairs), (entries, rigid_bodies, blocks) = self.equations[0].force.shape, self.most
        outputs, loads = self.outputs[0].constant.size, self.equations[0].drive.shape[0]
        lengths = {
            "F": capacity, "d": d, "R": pairs, "K": entries, "P": rigid_bodies, "B": blocks, "O": outputs, "H": loads,
        }  # fmt: skip
        return zeros(core.events.Forms, lengths, made=0)

    def _enlarge(self, needed: tuple[int, int, int], count: int) -> None:
        """Larger arrays where so many forms more would not fit; those in use elsewhere stay as they are."""
        capacity = self.forms.key.size
        if self.count + count <= capacity and all(n <= m for n, m in zip(needed, self.most, strict=True)):
            return
        self.most = tuple(max(pair) for pair in zip(needed, self.most, strict=True))
        while capacity < self.count + count:
            capacity *= 2
        larger = self._empty(capacity)
        for old, new in zip(self.forms[1:], larger[1:], strict=True):
            new[tuple(slice(0, length) for length in old.shape)] = old
        self.forms = larger

    def _add(
        self, items: Sequence[WantedForm], equations: Equations, forms: ClosedForms, active: NDArray[np.bool_]
    ) -> None:  # fmt: skip
        """Write closed forms with as many entries behind those that are there."""
        count, modes, first = len(items), forms.modes, self.count
        self._enlarge((modes.exponent.shape[1], forms.rigid_body_drive.shape[2], len(modes.blocks)), count)
        of_items = [self.outputs[item.system] for item in items]
        outputs = Outputs(*(stack([getattr(each, item.name) for each in of_items]) for item in fields(Outputs)))
        gaps = gap_rows(equations, forms.position, OF_DISPLACEMENT)
        parts = (each.by_rows for each in (gaps, forms.contact_force, _output_rows(outputs, forms, active)))
        rows = from_rows(np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True))
        driven = driven_entries(modes, self.rate)
        follow, position, velocity = (
            followed(each, modes, forms.load, driven) for each in (rows, forms.position, forms.velocity)
        )
        earlier = [self.last.get(item.parameters, (-1, -1)) for item in items]
        # dashpots of balls couple coordinates, whose relative speeds the ledger reads
        coupled = np.any(active & ~equations.rigid) or np.any(equations.C * ~np.eye(equations.C.shape[-1], dtype=bool))
        values: dict[str, Any] = {
            "key": np.full(count, items[0].key), "following": np.full(count, -1),
            "number": np.array([number for _, number in earlier]) + 1,
            "entries": np.full(count, modes.exponent.shape[1]),
            "rigid_bodies": np.full(count, forms.rigid_body_drive.shape[2]),
            "blocks": np.broadcast_to(modes.blocks, (count, *modes.blocks.shape)), "weight": rows.weight,
            "weight_size": np.abs(rows.weight), "rigid_body_weight": rows.rigid_body,
            "rigid_body_rate_weight": rows.rigid_body_rate, "constant": settled(rows, modes, forms.given),
            "through": rows.through, "follow": follow, "driven": driven, "shape": forms.position.weight,
            "shape_rate": forms.velocity.weight, "static": settled(forms.position, modes, forms.given),
            "static_rate": settled(forms.velocity, modes, forms.given),
            "position_through": forms.position.through[:, 2], "position_follow": position, "velocity_follow": velocity,
            **_uses_of_entries(forms, bool(coupled)),
        }  # fmt: skip
        for name, target in zip(self.forms._fields[1:], self.forms[1:], strict=True):
            # the others have their names in the closed forms, or in their modes
            home = forms if hasattr(forms, name) else modes
            value = values[name] if name in values else getattr(home, name)
            target[(slice(first, first + count), *(slice(0, length) for length in value.shape[1:]))] = value
        # known from here on, also to a thread that runs with these arrays
        for f, (item, (previous, number)) in enumerate(zip(items, earlier, strict=True), start=first):
            if previous >= 0:
                self.forms.following[previous] = f
            self.first.setdefault(item.parameters, f)
            self.last[item.parameters] = (f, number + 1)
            self.known[item.parameters, item.key] = f
        self.count += count


def _uses_of_entries(forms: ClosedForms, all_together: bool) -> dict[str, NDArray[Any]]:
    """Which entries move each coordinate, one coordinate after the other, and which two move one together."""
    used = (forms.velocity.weight != 0.0) | (forms.position.weight != 0.0)
    count, coordinates, entries = used.shape
    together = used.mT.astype(int) @ used.astype(int) > 0
    form, _, entry = np.nonzero(used)
    ends = used.sum(axis=2).cumsum(axis=1)
    before = np.concatenate([[0], np.cumsum(ends[:, -1])])
    members = np.zeros((count, coordinates * entries), dtype=np.int64)
    members[form, np.arange(form.size) - before[form]] = entry
    first = np.concatenate([np.zeros((count, 1), dtype=np.int64), ends], axis=1)
    return {"together": together | all_together, "first": first, "members": members}


def _output_rows(out: Outputs, forms: ClosedForms, active: NDArray[np.bool_]) -> Rows:
    """Rows of what is read at every sample; a contact force only where it acts."""
    p, v = forms.position, forms.velocity
    through = p.through @ out.position.mT + v.through @ out.rate.mT + out.drive
    follow = p.follow @ out.position.mT + v.follow @ out.rate.mT
    by_load(follow, ORDERS)[:, :, :3] += by_load(out.drive, 3)[:, :, ::-1]
    constant, apart = out.position @ p.constant, out.position @ p.apart
    constant[:, :, 0] += out.constant
    apart[:, :, 0] += out.constant
    rows = Rows(
        weight=out.position @ p.weight + out.rate @ v.weight,
        rigid_body=out.position @ p.rigid_body,
        rigid_body_rate=out.rate @ p.rigid_body,
        constant=constant,
        apart=apart,
        through=through,
        follow=follow,
    )
    force = forms.contact_force
    for o, j in np.argwhere(np.any(out.force != 0.0, axis=0) & active):
        weight = out.force[:, o, j][:, None]
        for here, there in zip(rows.by_rows, force.by_rows, strict=True):
            here[:, o] += weight * there[:, j]
    return rows
