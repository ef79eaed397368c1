"""What a study would cost before it runs."""

from __future__ import annotations

import numpy as np

from femimpact.integrators.stepping.step_size import shortest_contact
from femimpact.study.cost import history_cost, mesh_memory, picture_seconds, sweep_cost
from femimpact.study.prepared import prepare
from femimpact.study.study import Study
from femimpact.study.sweep_grid import most_frequencies
from femimpact.system.contact_pair import ContactPair
from femimpact.system.modes import first_elastic_frequency
from femimpact.system.system import System

__all__ = ["plan_lines"]


def plan_lines(study: Study) -> list[str]:
    """What would run: dofs, step, contact time, number of steps, memory and time.

    Raises
    ------
    InputError
        For everything that would stop the run before it starts.
    """
    prepared = prepare(study)
    full, small, method = prepared.full, prepared.small, prepared.method
    grid = method.interval(small, study.excitation, study.base.history_duration, prepared.record)
    steps = round(study.base.history_duration / grid)
    contact_time = shortest_contact(small)
    kind = "modal" if small.is_diagonal else "physical"
    lines = [
        f"dofs: {full.dofs} of the mesh ({full.nodes.size - 1} elements), {small.dofs} integrated ({kind}), "
        f"{len(small.balls)} ball(s), {len(small.contacts) - len(small.balls)} stop(s)",
        f"first natural frequency: {first_elastic_frequency(small):.6g} Hz"
        f"{' without ball' if small.balls else ''}{_rigid(small)}",
        f"contact time: {contact_time:.4g} s" if np.isfinite(contact_time) else "contact time: no contact",
    ]
    if study.structure.gravity:
        lines.append(f"gravity: {study.structure.gravity:g} m/s^2 along the deflection")
    for pair in small.contacts:
        fixed = ", fixed in space" if pair.fixed_to == "space" else ""
        preload = f", preloaded by {-1e3 * min(pair.gaps):.4g} mm" if pair.is_preloaded else ""
        lines.append(
            f"contact of {pair.name}: {pair.law.name}, {_numbers(pair)}restitution {pair.parameters.restitution:.4g}, "
            f"effective mass {1e3 * pair.effective_mass:.4g} g, {_clearance(pair.gaps)}"
            f"{preload}{fixed}"
        )
    origin = "given" if "dt" in study.method else "recommended"
    described = method.description(study.base.frequency, origin)
    lines.append(f"method: {study.method.get('name', 'newmark')}; {described}")
    history = history_cost(study, small, method, prepared.record)
    lines.append(
        f"history: {steps} {method.unit}, {grid:.4g} s apart, {study.base.words}, "
        f"takes about {history.memory / 1e6:.3g} MB and {history.seconds:.2g} s"
    )
    if study.sweep is not None:
        plan = study.sweep
        cases, middle = most_frequencies(plan), 0.5 * (plan.start + plan.stop)
        total = cases * plan.cycles / middle / method.time_grid(middle)
        swept = sweep_cost(study, small, method)
        lines.append(
            f"sweep: up to {cases} frequencies from {plan.start:g} to {plan.stop:g} Hz, {plan.cycles} cycles each, "
            f"{total:.3g} {method.unit}, takes about {swept.memory / 1e6:.3g} MB and {swept.seconds:.2g} s on one core"
        )
    if picture_seconds(study) > 0.0:
        lines.append(f"figures and movie: about {picture_seconds(study):.2g} s, when the rest is done")
    mesh = mesh_memory(full.nodes.size - 1, small.dofs if study.reduction else None)
    lines.append(f"mesh and modes: take about {max(mesh.values()) / 1e6:.3g} MB")
    lines.append("besides: some 200 MB for the libraries")
    lines += [f"note: {text}" for text in (*method.notes(small), *_files_elsewhere(study))]
    return lines + [f"warning: {text}" for text in prepared.warnings]


def _files_elsewhere(study: Study) -> list[str]:
    """Notes on files that a study reads from outside its folder: it cannot be handed on with that alone."""
    folder = study.path.parent.resolve()
    named = {"base.record": getattr(study.base, "record", None), "mesh.file": study.mesh.file}
    # links are followed
    places = {key: (name, (folder / name).resolve()) for key, name in named.items() if name}
    return [
        f"{key} = {name!r} is outside the folder of the study file: {place}"
        for key, (name, place) in places.items()
        if not place.is_relative_to(folder)
    ]


def _clearance(gaps: tuple[float, float]) -> str:
    if np.isfinite(sum(gaps)):
        return f"total clearance {1e3 * sum(gaps):.4g} mm"
    return f"wall on the {'+' if np.isfinite(gaps[0]) else '-'} side alone, gap {1e3 * min(gaps):.4g} mm"


def _rigid(small: System) -> str:
    return "" if small.first_frequency > 0.0 else ", above a rigid motion at 0 Hz"


def _numbers(pair: ContactPair) -> str:
    """What characterises a pair's law, in its units."""
    shown = pair.law.shown_numbers(pair.effective_mass)
    return "".join(f"{name} {value:.5g}{unit and f' {unit}'}, " for name, value, unit in shown)
