"""Closed forms of every state of compliant contact, and the step from one to another."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from femimpact.integrators.kernels.compiling import called
from femimpact.integrators.kernels.crossing import Flight, unit_phase

__all__ = ["CONTACT", "FREE", "REBOUND", "Forms", "Waves", "enter_state", "read_state"]

FREE, CONTACT, REBOUND = range(3)
"""What a pair does; CONTACT and REBOUND times the side of the wall."""


class Forms(NamedTuple):
    """Closed forms of all states of contact: S states, K entries, P particles, R pairs, d coordinates, O outputs.

    A state's number has one digit of base 3 for each pair: 0 without force, 1 and 2 at its + and - wall.
    Watched scalars: x of every pair, then k x + c x' of every pair.
    """

    exponent: NDArray[Any]  # (S, K) complex
    coupling: NDArray[Any]  # (S, K, K) complex; see Watch
    blocks: NDArray[Any]  # (S, B, 2)
    size: NDArray[Any]  # (S, K)
    particle_given: NDArray[Any]  # (S, P)
    weight: NDArray[Any]  # (S, 2R, K) complex
    weight_size: NDArray[Any]  # (S, 2R, K)
    particle_weight: NDArray[Any]  # (S, 2R, P)
    particle_rate_weight: NDArray[Any]  # (S, 2R, P)
    constant: NDArray[Any]  # (S, 2R)
    shape: NDArray[Any]  # (S, d, K) complex
    shape_rate: NDArray[Any]  # (S, d, K) complex
    particle_shape: NDArray[Any]  # (S, d, P)
    static: NDArray[Any]  # (S, d)
    to_entry_u: NDArray[Any]  # (S, K, d) complex
    to_entry_v: NDArray[Any]  # (S, K, d) complex
    to_particle: NDArray[Any]  # (S, P, d)
    gap: NDArray[Any]  # (2, R) to the + and - wall
    stiffness: NDArray[Any]  # (R,)


class Waves(NamedTuple):
    """What the drive of every case adds: its sine, and the steady answers to it."""

    omega: NDArray[Any]  # (cases,)
    phase: NDArray[Any]  # (cases,)
    amplitude: NDArray[Any]  # (cases,) m/s^2 or N
    sine: NDArray[Any]  # (cases, S, 2R) complex
    harmonic: NDArray[Any]  # (cases, S, d) complex


@called
def read_state(
    number: int, forms: Forms, harmonic: NDArray[Any], omega: float, flight: Flight, state: NDArray[Any]
) -> None:
    """Displacements and velocities of all coordinates (2, d) at the present time."""
    phase = unit_phase(omega, flight.clock)
    shape, shape_rate, particles = forms.shape[number], forms.shape_rate[number], forms.particle_shape[number]
    for i in range(state.shape[1]):
        turned = harmonic[i] * phase
        x, v = forms.static[number, i] + turned.real, -omega * turned.imag
        for k in range(flight.entry.size):
            x += (shape[i, k] * flight.entry[k]).real
            v += (shape_rate[i, k] * flight.entry[k]).real
        for p in range(flight.particle.size):
            x += particles[i, p] * flight.particle[p]
            v += particles[i, p] * flight.particle_rate[p]
        state[0, i], state[1, i] = x, v


@called
def enter_state(
    number: int, forms: Forms, harmonic: NDArray[Any], omega: float, state: NDArray[Any], flight: Flight
) -> None:
    """The homogeneous part and the particles of a state in another closed form; the state is used up."""
    phase = unit_phase(omega, flight.clock)
    for i in range(state.shape[1]):
        turned = harmonic[i] * phase
        state[0, i] -= forms.static[number, i] + turned.real
        state[1, i] += omega * turned.imag
    for k in range(flight.entry.size):
        total = complex(0.0, 0.0)
        for i in range(state.shape[1]):
            total += forms.to_entry_u[number, k, i] * state[0, i] + forms.to_entry_v[number, k, i] * state[1, i]
        flight.entry[k] = total
    for p in range(flight.particle.size):
        x, v = 0.0, 0.0
        for i in range(state.shape[1]):
            x += forms.to_particle[number, p, i] * state[0, i]
            v += forms.to_particle[number, p, i] * state[1, i]
        flight.particle[p], flight.particle_rate[p] = x, v
