"""OpenSees: elastic beam elements with consistent mass, a node as ball, gap materials between tip and ball.

Newmark (average acceleration) with Newton's iteration. Its `ViscoelasticGap` is the Kelvin-Voigt wall of the problem
except that it may pull at the end of a contact, which the problem rules out: no step makes its history exact.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import tempfile
from pathlib import Path

import numpy as np

NAME = "OpenSees"
SPACE = "20 dofs"
MODES = 20
SETTINGS = (2e-4, 1e-4, 5e-5, 2e-5)
BALL_NODE = 1000


def missing() -> str:
    """Why it cannot run here; empty if it can."""
    return "" if importlib.util.find_spec("openseespy") else "openseespy is not installed (extra peers)"


def _opensees():
    """OpenSees as a module."""
    # its package for Linux brings liblapack, which does not find the libblas beside it
    for package in filter(None, [importlib.util.find_spec("openseespylinux")]):
        for library in Path(package.origin).parent.glob("lib/libblas.so.*"):
            ctypes.CDLL(str(library))
    return importlib.import_module("openseespy.opensees")


def usual(task) -> float:
    """Step that the task asks for, s."""
    return task.dt


def history(problem, task, frequency, duration, setting):
    """The tip after every step of `setting` seconds, as its recorder writes it."""
    ops = _opensees()
    data = problem.data
    beam, count = data["beam"], data["elements"][0]
    area = beam["width"] * beam["thickness"]
    inertia = beam["width"] * beam["thickness"] ** 3 / 12.0
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for i in range(count + 1):
        ops.node(i + 1, beam["length"] * i / count, 0.0)
        ops.fix(i + 1, *((1, 1, 1) if i == 0 else (1, 0, 0)))
    ops.geomTransf("Linear", 1)
    for i in range(count):
        ops.element(
            "elasticBeamColumn", i + 1, i + 1, i + 2, area, beam["young_modulus"], inertia, 1,
            "-mass", beam["density"] * area, "-cMass",
        )  # fmt: skip
    tip = count + 1
    ops.mass(tip, 0.0, data["box"]["mass"], 0.0)
    if task.ball:
        _ball(ops, data, tip)
    # the ball has no part in the structure's damping
    alpha, beta = problem.full(ball=task.ball).rayleigh
    ops.region(1, "-ele", *range(1, count + 1), "-rayleigh", alpha, beta, 0.0, 0.0)
    ops.region(2, "-node", *range(1, tip + 1), "-rayleigh", alpha, beta, 0.0, 0.0)
    top = problem.amplitude * (2.0 * np.pi * frequency) ** 2
    steps = round(duration / setting)
    ops.timeSeries("Trig", 1, 0.0, 2.0 * duration, 1.0 / frequency, "-factor", top)
    # loads of the moving base by hand: UniformExcitation with consistent mass gave 1.27 times the exact response
    ops.pattern("Plain", 1, 1)
    for i, (across, turning) in enumerate(problem.full(ball=task.ball).base_load.reshape(-1, 2)):
        ops.load(i + 2, 0.0, float(across), float(turning))
    if task.ball:
        ops.load(BALL_NODE, 0.0, data["ball"]["mass"], 0.0)
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder) / "tip.txt"
        ops.recorder("Node", "-file", str(written), "-precision", 15, "-time", "-node", tip, "-dof", 2, "disp")
        ops.constraints("Plain")
        ops.numberer("RCM")
        ops.system("BandGeneral")
        ops.test("NormDispIncr", 1e-12, 20)
        ops.algorithm("Newton")
        ops.integrator("Newmark", 0.5, 0.25)
        ops.analysis("Transient")
        failed = ops.analyze(steps, setting)
        ops.wipe()
        if failed:
            raise RuntimeError("OpenSees did not converge")
        table = np.loadtxt(written)
    return table[:, 0], table[:, 1]


def _ball(ops, data, tip):
    """A node at the tip's place that moves across, with one gap element to each wall."""
    ops.node(BALL_NODE, data["beam"]["length"], 0.0)
    ops.fix(BALL_NODE, 1, 0, 1)
    ops.mass(BALL_NODE, 0.0, data["ball"]["mass"], 0.0)
    wall = data["wall"]
    # it reports each impact on the screen
    ops.logFile("/dev/null", "-noEcho")
    ops.uniaxialMaterial("ViscoelasticGap", 1, wall["stiffness"], wall["damping"], -data["ball"]["gap"])
    ops.element("zeroLength", BALL_NODE, BALL_NODE, tip, "-mat", 1, "-dir", 2)
    ops.element("zeroLength", BALL_NODE + 1, tip, BALL_NODE, "-mat", 1, "-dir", 2)
