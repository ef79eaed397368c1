"""A user's script as a type checker reads it: every public name has a type, and a misspelt one is a fault."""

from pathlib import Path
from typing import assert_type

import femimpact as fi

beam = fi.Beam.uniform(length=0.23, width=0.020, thickness=1e-3, young_modulus=70e9, density=2700.0)
ball = fi.Impactor("ball", at="tip", mass=3.4e-3, gap=4e-3, contact=fi.KelvinVoigt(restitution=0.6, contact_time=2e-3))
box = fi.PointMass("box", at="tip", mass=0.023)
structure = fi.Structure(beam, [box], [ball], fi.Rayleigh(ratio=0.0029, modes=(1, 2)))
system = fi.reduce(fi.assemble(structure, elements=40), modes=8)
assert_type(system, fi.System)
assert_type(fi.solve_modes(system, count=2), fi.system.Modes)

record = fi.Recorder(channels=["tip", "root.surface_stress"], every=10)
run = fi.integrate(system, fi.Sine(amplitude=0.2e-3, frequency=5.0), fi.EventDriven(), duration=60.0, record=record)
assert_type(run, fi.response.Response)
assert_type(run.impacts, fi.response.Impacts)
assert_type(run.energy, fi.response.EnergyLedger | None)

curve = fi.frequency_sweep(system, 0.2e-3, [4.0, 5.0, 6.0], fi.Newmark(dt=1e-4), cycles=300)
assert_type(curve, fi.sweep.FrequencyResponse)
assert_type(curve.damping, fi.signals.DampingEstimate)
assert_type(fi.run_study(fi.load_study(Path("study.toml")), Path("out")), fi.app.StudyResults)
assert_type(fi.__version__, str)

# the checker's settings turn an ignored line without a fault into a fault
fi.Bean  # type: ignore[attr-defined]  # noqa: B018
fi.Newmark(step=1e-4)  # type: ignore[call-arg]
