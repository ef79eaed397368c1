"""One step without contact force in physical dofs: banded matrices, one case alone or many side by side."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import compiled
from femimpact.integrators.kernels.flight import add
from femimpact.integrators.layout import Motion, Operator, Scheme

__all__ = ["free_step_banded", "free_step_banded_single"]


@compiled
def _scale(target: NDArray[Any], scale: float) -> None:
    for c in range(target.size):
        target[c] *= scale


@compiled
def free_step_banded(op: Operator, s: Scheme, m: Motion, acting: NDArray[Any]) -> None:
    """The step in physical dofs: banded right-hand side, forward and back substitution."""
    n, cases = m.q.shape
    rhs, u_felt, v_felt = m.scratch[0], m.scratch[1], m.scratch[2]
    felt = 1.0 - s.alpha_f
    for i in range(n):
        load, q, v, a = op.load[i], m.q[i], m.v[i], m.a[i]
        u_i, v_i, rhs_i = u_felt[i], v_felt[i], rhs[i]
        for c in range(cases):
            u_i[c] = q[c] + felt * (s.dt * v[c] + s.predict_u * a[c])
            v_i[c] = v[c] + felt * s.predict_v * a[c]
            rhs_i[c] = load * acting[c]
    for i in range(n):
        add(rhs[i], -op.damping_band[0, i], v_felt[i])
        add(rhs[i], -op.stiffness_band[0, i], u_felt[i])
        for k in range(1, min(op.stiffness_band.shape[0], n - i)):
            add(rhs[i], -op.damping_band[k, i], v_felt[i + k])
            add(rhs[i], -op.stiffness_band[k, i], u_felt[i + k])
            add(rhs[i + k], -op.damping_band[k, i], v_felt[i])
            add(rhs[i + k], -op.stiffness_band[k, i], u_felt[i])
    if s.alpha_m != 0.0:
        for i in range(n):
            add(rhs[i], -s.alpha_m * op.mass_band[0, i], m.a[i])
            for k in range(1, min(op.mass_band.shape[0], n - i)):
                add(rhs[i], -s.alpha_m * op.mass_band[k, i], m.a[i + k])
                add(rhs[i + k], -s.alpha_m * op.mass_band[k, i], m.a[i])
    _solve_banded(op.cholesky_band, rhs)
    for i in range(n):
        q, v, a, rhs_i = m.q[i], m.v[i], m.a[i], rhs[i]
        for c in range(cases):
            q[c] += s.dt * v[c] + s.predict_u * a[c] + s.correct_u * rhs_i[c]
        for c in range(cases):
            v[c] += s.predict_v * a[c] + s.correct_v * rhs_i[c]
            a[c] = rhs_i[c]


@compiled
def free_step_banded_single(
    op: Operator, s: Scheme, q: NDArray[Any], v: NDArray[Any], a: NDArray[Any], acting: float, scratch: NDArray[Any]
) -> None:
    """The same step of one case alone."""
    n, bands, lower = q.size, op.cholesky_band.shape[0], op.cholesky_band
    rhs, u_felt, v_felt = scratch[0, :, 0], scratch[1, :, 0], scratch[2, :, 0]
    felt = 1.0 - s.alpha_f
    for i in range(n):
        u_felt[i] = q[i] + felt * (s.dt * v[i] + s.predict_u * a[i])
        v_felt[i] = v[i] + felt * s.predict_v * a[i]
        rhs[i] = op.load[i] * acting - op.damping_band[0, i] * v_felt[i] - op.stiffness_band[0, i] * u_felt[i]
    for k in range(1, bands):
        damping, stiffness = op.damping_band[k], op.stiffness_band[k]
        for i in range(n - k):
            rhs[i] -= damping[i] * v_felt[i + k] + stiffness[i] * u_felt[i + k]
        for i in range(n - k):
            rhs[i + k] -= damping[i] * v_felt[i] + stiffness[i] * u_felt[i]
    if s.alpha_m != 0.0:
        for i in range(n):
            rhs[i] -= s.alpha_m * op.mass_band[0, i] * a[i]
            for k in range(1, min(op.mass_band.shape[0], n - i)):
                rhs[i] -= s.alpha_m * op.mass_band[k, i] * a[i + k]
                rhs[i + k] -= s.alpha_m * op.mass_band[k, i] * a[i]
    for i in range(n):
        value = rhs[i]
        for k in range(1, min(bands, i + 1)):
            value -= lower[k, i - k] * rhs[i - k]
        rhs[i] = value * lower[0, i]
    for i in range(n - 1, -1, -1):
        value = rhs[i]
        for k in range(1, min(bands, n - i)):
            value -= lower[k, i] * rhs[i + k]
        rhs[i] = value * lower[0, i]
    for i in range(n):
        q[i] += s.dt * v[i] + s.predict_u * a[i] + s.correct_u * rhs[i]
        v[i] += s.predict_v * a[i] + s.correct_v * rhs[i]
        a[i] = rhs[i]


@compiled
def _solve_banded(lower: NDArray[Any], rhs: NDArray[Any]) -> None:
    """Solve L L^T x = rhs in place; L by its lower bands with the reciprocal of its diagonal in row 0."""
    bands, n = lower.shape
    for i in range(n):
        for k in range(1, min(bands, i + 1)):
            add(rhs[i], -lower[k, i - k], rhs[i - k])
        _scale(rhs[i], lower[0, i])
    for i in range(n - 1, -1, -1):
        for k in range(1, min(bands, n - i)):
            add(rhs[i], -lower[k, i], rhs[i + k])
        _scale(rhs[i], lower[0, i])
