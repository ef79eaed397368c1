"""Modal coordinates: the same equations on a few normal modes, and what the missing ones leave out."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg

from femimpact.arrays import Array, own
from femimpact.errors import checked, require, require_type, truth
from femimpact.system.contact_pair import ContactPair, pair_along
from femimpact.system.hermite import reduced_reactions
from femimpact.system.matrices import diagonal_matrix
from femimpact.system.modes import (
    Modes,
    damping_ratios,
    lowest_modes,
    mode_count,
    solve_stiffness,
)
from femimpact.system.system import System, with_checked_fields

NEGLIGIBLE = 1e-12
"""Share of a direction's static flexibility below which a residual adds nothing but rounding."""

ENOUGH_FLEXIBILITY = 0.95
"""Share of the unreduced structure's flexibility at a contact that kept modes should have."""


def reduce(system: System, modes: int, static_correction: bool = False) -> System:
    """The system on its lowest normal modes, u = Phi q: a `System` again, with diagonal matrices.

    q'' + 2 zeta omega q' + omega^2 q = Phi^T (constant_load - base_load ub'') + sum_j (b_j^T Phi) F_j.

    Parameters
    ----------
    modes : int
        How many normal modes are kept, 1 to the number of dofs; exactly so many.
    static_correction : bool
        Add one residual attachment vector for every distinct contact direction.

    Returns
    -------
    System
        M = 1, C = diag(2 zeta omega), K = diag(omega^2); contacts keep their effective mass.
        Attachment vectors come behind the modes, faster than all of them.

    Raises
    ------
    InputError
        If the damping does not decouple, or a static correction is asked of a structure that is not held.

    Notes
    -----
    The residual attachment vector of a direction b is what the kept modes miss of the static deflection
    under a unit force there (residual flexibility: MacNeal, 1971; Rubin, 1975),

        psi = K^-1 b - sum_k phi_k (phi_k^T b)/omega_k^2.

    It is M- and K-orthogonal to the kept modes. Several of them are made orthogonal to one another by
    psi^T K psi w = omega^2 psi^T M psi w, so that the system stays diagonal, and b^T K^-1 b is exact at
    every contact. Their frequencies are no natural frequencies: below them the correction is static.
    """
    static_correction = checked("static_correction", static_correction, truth())
    count = mode_count(system, modes, "modes")
    modes_and_next = lowest_modes(system, min(count + 1, system.dofs))
    return _on_modes(system, modes_and_next, modes_and_next.damping_ratio, count, static_correction)


def reduced_on(
    system: System,
    modes_and_next: Modes,  # of its mass and stiffness, one more than are kept unless there is none
    modes: int,
) -> System:
    """The system on the lowest of some modes that were found before, perhaps with another damping; see `reduce`."""
    ratio = damping_ratios(system, modes_and_next.vectors, 2.0 * math.pi * modes_and_next.natural_frequency)
    return _on_modes(system, modes_and_next, ratio, modes, False)


def _on_modes(system: System, modes_and_next: Modes, ratio: Array, count: int, static_correction: bool) -> System:
    """The system reduced to the lowest `count` modes found, with the damping ratio given for each; see `reduce`."""
    frequency = modes_and_next.natural_frequency
    next_one = float(frequency[count]) if count < frequency.size else math.inf
    phi, omega = np.ascontiguousarray(modes_and_next.vectors[:, :count]), 2.0 * math.pi * frequency[:count]
    ratio = ratio[:count]
    if static_correction and system.contacts:
        extra, extra_omega = _attachment_vectors(system, phi, omega)
        phi, omega = np.hstack([phi, extra]), np.append(omega, extra_omega)
        ratio = np.append(ratio, damping_ratios(system, extra, extra_omega))
    if system.rayleigh is None:
        _check_decoupled(system, phi)
    # of rigid motions, which may be damped, though they have no ratio
    damping_of_rigid = np.einsum("ij,ij->j", phi, system.C @ phi) if system.rayleigh is None else system.rayleigh[0]
    contacts = tuple(pair_along(pair, own(pair.direction @ phi)) for pair in system.contacts)
    return with_checked_fields(
        system,
        M=diagonal_matrix(np.ones(omega.size)),
        C=diagonal_matrix(np.where(omega > 0.0, 2.0 * ratio * omega, damping_of_rigid)),
        K=diagonal_matrix(omega**2),
        stiffness_factor=diagonal_matrix(omega),
        base_load=own(phi.T @ system.base_load),
        rigid_translation=own(phi.T @ (system.M @ system.rigid_translation)),
        expansion=np.asarray(system.expansion @ phi),
        contacts=contacts,
        directions={name: own(row @ phi) for name, row in system.directions.items()},
        constant_load=own(phi.T @ system.constant_load),
        # `constant_resultant` stays: nothing is left out of a resultant, as nothing is of the total mass
        reactions=reduced_reactions(system.reactions, phi),
        first_left_out=min(next_one, system.first_left_out),
        unreduced=system.unreduced or system,
    )


def _attachment_vectors(system: System, phi: Array, omega: Array) -> tuple[Array, Array]:
    """Mass-normalised residual attachment vectors of all contact directions, and their omega (rad/s)."""
    held = system.first_frequency > 0.0
    require(held, "static_correction", True, "", "needs a structure that is held: K^-1 b does not exist")
    loads = np.array([pair.direction for pair in system.contacts]).T
    loads = loads[:, np.abs(loads).max(axis=0) > 0.0]
    if not loads.size:
        return np.zeros((system.dofs, 0)), np.zeros(0)
    static = solve_stiffness(system, loads)
    psi = static - phi @ ((phi.T @ loads) / omega[:, None] ** 2)
    # once more against the mass, for what rounding left
    psi -= phi @ (phi.T @ (system.M @ psi))
    bent = system.stiffness_factor @ psi
    residual = np.einsum("ij,ij->j", bent, bent)
    chosen = residual > NEGLIGIBLE * np.einsum("ij,ij->j", loads, static)
    psi, bent = (array[:, chosen] / np.sqrt(residual[chosen]) for array in (psi, bent))
    if not psi.size:
        return psi, np.zeros(0)
    # equal and opposite directions, as of two balls in one box, count once
    share, mix = scipy.linalg.eigh(bent.T @ bent)
    psi = psi @ (mix[:, share > NEGLIGIBLE] / np.sqrt(share[share > NEGLIGIBLE]))
    inverse_square, mix = scipy.linalg.eigh(psi.T @ (system.M @ psi))
    psi = (psi @ mix / np.sqrt(inverse_square))[:, ::-1]
    return psi, np.linalg.norm(system.stiffness_factor @ psi, axis=0)


def truncation_notes(system: System) -> tuple[str, ...]:
    """Notes, with numbers, on the flexibility at contacts that a reduced system leaves out.

    Returns
    -------
    tuple of str
        Empty for physical dofs and without contacts. Per pair: the fastest kept coordinate against
        1/(contact time) of a compliant law, and the static flexibility of the kept coordinates where it is
        below 95 % of the structure's. One more where an impact is rigid, or too short for the modes.

    Notes
    -----
    Attachment vectors of a static correction count as coordinates: they make the flexibility exact, and
    their frequency is up to where they are static.
    """
    require_type(system, System, "system")
    # a System by matrices may be diagonal without being truncated; `reduce` leaves a dense expansion
    truncated = isinstance(system.expansion, np.ndarray) and math.isfinite(system.highest_kept)
    if not (system.contacts and system.is_diagonal and truncated):
        return ()
    omega = np.sqrt(system.K.diagonal())
    highest = float(omega.max()) / (2.0 * math.pi)
    notes: list[str] = []
    stiff = [pair for pair in system.contacts if _is_short(pair, highest)]
    for pair in system.contacts:
        if _is_short(pair, highest) and not pair.parameters.is_rigid:
            notes.append(
                f"{pair.name}: {kept_modes(omega.size)} kept, up to {highest:.4g} Hz: below 1/(contact time) = "
                f"{1.0 / pair.parameters.contact_time:.4g} Hz, so the course of the force is not resolved"
            )
        notes.extend(_flexibility_note(pair, omega))
    if stiff:
        notes.append(_stiff_note(stiff, omega.size))
    return tuple(notes)


def _is_short(pair: ContactPair, highest: float) -> bool:
    """True if a contact is rigid, or over before the fastest kept coordinate (Hz) has turned once."""
    return pair.parameters.is_rigid or 0.0 < highest * pair.parameters.contact_time < 1.0


def _flexibility_note(pair: ContactPair, omega: Array) -> list[str]:
    if not math.isfinite(pair.flexibility) or not np.all(omega > 0.0):
        return []
    modal = float(np.sum((pair.direction / omega) ** 2))
    if modal >= ENOUGH_FLEXIBILITY * pair.flexibility:
        return []
    return [
        f"{pair.name}: {kept_modes(omega.size)} kept, with a static flexibility of {modal:.4g} m/N at the contact of "
        f"the structure's {pair.flexibility:.4g} m/N: keep more, or reduce(..., static_correction=True)"
    ]


def _stiff_note(pairs: list[ContactPair], modes: int) -> str:
    """One note for all rigid or short contacts, with the mass that acts in an impulse on the kept modes."""
    mobilities = [float(pair.direction @ pair.direction) for pair in pairs]
    masses = ", ".join(
        f"{pair.name} {1.0 / mobility:.4g} kg"
        for pair, mobility in zip(pairs, mobilities, strict=True)
        if mobility > 0.0
    )
    return (
        f"{kept_modes(modes)} kept: the peak force of a rigid or very short contact does not converge with their "
        "number; displacement and the whole energy loss do. Impulse and contact loss of a single rigid impact go with "
        "the mass that an impulse moves, which settles only where there is a body at the contact; of these modes: "
        f"{masses or 'none'}"
    )


def kept_modes(count: int) -> str:
    """Words for a number of modes."""
    return f"{count} mode{'s' if count > 1 else ''}"


def _check_decoupled(system: System, phi: Array) -> None:
    """Raise unless the modal damping matrix is diagonal to 1e-6 of its diagonal, or to the rounding of its terms."""
    damping = phi.T @ (system.C @ phi)
    diagonal = np.sqrt(np.abs(np.diag(damping)))
    off = np.abs(damping - np.diag(np.diag(damping)))
    # of a rigid motion that nothing damps the diagonal is zero, or rounding
    rounding = 10.0 * system.dofs * np.finfo(float).eps * (np.abs(phi).T @ (abs(system.C) @ np.abs(phi)))
    allowed = "must decouple on the normal modes (Rayleigh does) to reduce the system"
    decoupled = bool(np.all(off <= 1e-6 * np.outer(diagonal, diagonal) + rounding))
    require(decoupled, "damping", float(off.max()), "1/s", allowed)
