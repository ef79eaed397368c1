"""The reference structure: the one consistent set of data behind the published 5.30 and 4.98 Hz."""

import pytest

import femimpact as fi


@pytest.fixture(scope="session")
def reference() -> fi.Structure:
    return fi.Structure(
        beam=fi.Beam.uniform(length=0.23026615, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700),
        masses=[fi.PointMass("box", at="tip", mass=0.02290976)],
        impactors=[
            fi.Impactor(
                "ball", at="tip", mass=3.43e-3, gap=4e-3, contact=fi.KelvinVoigt(restitution=0.6, contact_time=2e-3)
            )
        ],
        damping=fi.Rayleigh(ratio=0.0029, modes=(1, 2)),
    )


@pytest.fixture(scope="session")
def system(reference: fi.Structure) -> fi.System:
    return fi.assemble(reference, elements=40)


@pytest.fixture(scope="session")
def small(system: fi.System) -> fi.System:
    return fi.reduce(system, modes=8)
