"""What a convergence study prints: its tables and notes, in 80 columns."""

from __future__ import annotations

from femimpact.convergence import StepConvergence
from femimpact.convergence.text import cell, note_lines, row_line, table_lines
from femimpact.study.convergence import WrittenConvergence

__all__ = ["convergence_lines"]


def convergence_lines(found: WrittenConvergence) -> list[str]:
    """Lines of at most 80 columns: for each axis the relative errors, and what they say."""
    lines: list[str] = []
    for table in [*found.tables.tables.values(), *([found.statistics] if found.statistics is not None else [])]:
        lines += [*table_lines(table), ""]
    if found.step is not None:
        lines += [*_steps(found.step), ""]
    return lines + note_lines([*found.notes, *found.mesh.notes, *(found.step.notes if found.step else ())])


def _steps(step: StepConvergence) -> list[str]:
    lines = [
        f"Runs in steps: relative errors; orders {step.linear_order:.2f} and {step.first_impact_order:.2f}",
        row_line("dt (s)", ["no ball", "impact", "energy"]),
    ]
    for row in zip(step.dt, step.linear_error, step.first_impact_error, step.energy_residual, strict=True):
        lines.append(row_line(f"{row[0]:.4g}", [cell(value) for value in row[1:]]))
    return lines
