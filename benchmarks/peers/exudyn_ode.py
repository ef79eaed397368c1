"""Exudyn: all dofs of ten elements as one generic second-order object, the ball as another, walls as a spring-damper.

Implicit Newmark of Exudyn (average acceleration), its own Newton iteration and its treatment of changing contact;
forces as symbolic functions, which run inside its C++ code.
"""

from __future__ import annotations

import importlib.util

import numpy as np

NAME = "Exudyn"
SPACE = "20 dofs"
MODES = 20
SETTINGS = (2e-4, 1e-4, 5e-5, 2e-5, 1e-5)


def missing() -> str:
    """Why it cannot run here; empty if it can."""
    return "" if importlib.util.find_spec("exudyn") else "exudyn is not installed (extra peers)"


def usual(task) -> float:
    """Step that the task asks for, s."""
    return task.dt


def history(problem, task, frequency, duration, setting):
    """The tip after every step of `setting` seconds."""
    import sys

    # its build without range checks, as its manual recommends for speed
    sys.exudynFast = True
    import exudyn as exu
    from exudyn.itemInterface import (
        LoadCoordinate,
        NodeGenericODE2,
        ObjectConnectorCoordinateSpringDamper,
        ObjectGenericODE2,
        SensorNode,
    )
    from exudyn.itemInterface import MarkerNodeCoordinate as Coordinate

    system, symbolic = problem.full(ball=task.ball), exu.symbolic
    omega = 2.0 * np.pi * frequency
    top = problem.amplitude * omega**2
    at = int(np.argmax(np.abs(system.point_row("tip"))))
    scene = exu.SystemContainer()
    mbs = scene.AddSystem()

    def sine(mbs, t, load):
        return load * symbolic.sin(omega * t)

    def add(M, C, K, load):
        n = len(load)
        zeros = [0.0] * n
        node = mbs.AddNode(
            NodeGenericODE2(
                referenceCoordinates=zeros,
                initialCoordinates=zeros,
                initialCoordinates_t=zeros,
                numberOfODE2Coordinates=n,
            )
        )
        mbs.AddObject(ObjectGenericODE2(nodeNumbers=[node], massMatrix=M, dampingMatrix=C, stiffnessMatrix=K))
        for i, value in enumerate(load):
            marker = mbs.AddMarker(Coordinate(nodeNumber=node, coordinate=i))
            made = mbs.AddLoad(LoadCoordinate(markerNumber=marker, load=float(value) * top, loadUserFunction=sine))
            _symbolic(mbs, sine, "loadUserFunction", made)
        return node

    beam = add(*(matrix.toarray() for matrix in (system.M, system.C, system.K)), system.base_load)
    if task.ball:
        pair = system.contacts[0]
        one = np.array([[pair.mass]])
        ball = add(one, 0.0 * one, 0.0 * one, [pair.mass])
        markers = [
            mbs.AddMarker(Coordinate(nodeNumber=beam, coordinate=at)),
            mbs.AddMarker(Coordinate(nodeNumber=ball, coordinate=0)),
        ]
        plus, minus = (float(gap) for gap in pair.gaps)
        k, c = pair.parameters.stiffness, pair.parameters.damping

        def wall(mbs, t, item, u, v, stiffness, damping, offset):
            zero = symbolic.Real(0.0)
            push = k * (u - plus) + c * v
            back = k * (u + minus) + c * v
            pressed = symbolic.IfThenElse(push > zero, push, zero)
            drawn = symbolic.IfThenElse(back < zero, back, zero)
            return symbolic.IfThenElse(u > plus, pressed, symbolic.IfThenElse(u < -minus, drawn, zero))

        spring = ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, springForceUserFunction=wall)
        _symbolic(mbs, wall, "springForceUserFunction", mbs.AddObject(spring))
    sensor = mbs.AddSensor(
        SensorNode(nodeNumber=beam, storeInternal=True, outputVariableType=exu.OutputVariableType.Coordinates)
    )
    mbs.Assemble()
    _solve(exu, mbs, duration, setting)
    data = np.array(mbs.GetSensorStoredData(sensor))
    _KEPT.append(scene)
    return data[1:, 0], data[1:, 1 + at]


_KEPT: list = []


def _symbolic(mbs, function, name, item):
    from exudyn.advancedUtilities import CreateSymbolicUserFunction

    made = CreateSymbolicUserFunction(mbs, function, name, item)
    # the solver reads it after this returns
    _KEPT.append((mbs, function, made))
    change = mbs.SetLoadParameter if name.startswith("load") else mbs.SetObjectParameter
    change(item, name, made)


def _solve(exu, mbs, duration, dt):
    settings = exu.SimulationSettings()
    run = settings.timeIntegration
    run.numberOfSteps, run.endTime = round(duration / dt), duration
    run.newton.useModifiedNewton = True
    run.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = dt
    settings.parallel.numberOfThreads = 1
    settings.displayStatistics = False
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
