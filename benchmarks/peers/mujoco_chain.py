"""MuJoCo: a chain of rigid links with hinge springs, the ball on a slide, walls as a spring with a dead band.

Its elements are rigid links, not beams: one factor on the springs makes the first natural frequency the problem's,
one on the joints' dampers the first damping ratio; higher modes differ. The walls' dashpot, which may not act between
contacts nor pull, and the base's motion (as gravity) are set from Python before every step.
"""

from __future__ import annotations

import functools
import importlib.util

import numpy as np

NAME = "MuJoCo"
SPACE = "10 links"
MODES = 20
SETTINGS = (2e-4, 1e-4, 5e-5, 2e-5, 1e-5)


def missing() -> str:
    """Why it cannot run here; empty if it can."""
    return "" if importlib.util.find_spec("mujoco") else "mujoco is not installed (extra peers)"


def usual(task) -> float:
    """Step that the task asks for, s; without the ball smaller, as the chain is unstable at 1/2000 s."""
    return min(task.dt, 2e-4)


def _document(problem, ball, stiffness, damping):
    """The model's XML: hinges in the middle of the links' shares of the beam, so that a half link is held."""
    data = problem.data
    beam, count = data["beam"], data["elements"][0]
    link = beam["length"] / count
    share = beam["density"] * beam["width"] * beam["thickness"] * link
    hinge = f'<joint type="hinge" axis="0 -1 0" stiffness="{stiffness!r}" damping="{damping!r}"/>'
    text = ""
    for i in range(count):
        # hinge i stands in the middle of element i; the first half element is held, the last link a half one
        size = link if i < count - 1 else 0.5 * link
        mass = share * size / link
        spin = mass * size**2 / 12.0
        at = 0.5 * link if i == 0 else link
        text += f'<body pos="{at!r} 0 0">{hinge}'
        text += f'<inertial pos="{0.5 * size!r} 0 0" mass="{mass!r}" diaginertia="{spin!r} {spin!r} {spin!r}"/>'
    end = 0.5 * link
    tiny = 1e-12
    text += f'<body pos="{end!r} 0 0"><inertial pos="0 0 0" mass="{data["box"]["mass"]!r}"'
    text += f' diaginertia="{tiny} {tiny} {tiny}"/></body><site name="tip" pos="{end!r} 0 0"/>'
    tendon = ""
    if ball:
        gap = data["ball"]["gap"]
        text += f'<body pos="{end!r} 0 0"><joint name="ball" type="slide" axis="0 0 1"/><inertial pos="0 0 0"'
        text += f' mass="{data["ball"]["mass"]!r}" diaginertia="{tiny} {tiny} {tiny}"/></body>'
        tendon = f'<tendon><fixed stiffness="{data["wall"]["stiffness"]!r}" springlength="{-gap!r} {gap!r}">'
        tendon += '<joint joint="ball" coef="1"/></fixed></tendon>'
    text += "</body>" * count
    option = '<option integrator="implicitfast" gravity="0 0 0"><flag contact="disable" constraint="disable"/></option>'
    compiler = '<compiler boundmass="0" boundinertia="0" inertiafromgeom="false"/>'
    return f"<mujoco>{compiler}{option}<worldbody>{text}</worldbody>{tendon}</mujoco>"


@functools.cache
def _calibrated(problem):
    """Stiffness and damping of the hinges: first natural frequency and damping ratio are the problem's."""
    import mujoco

    data = problem.data
    beam = data["beam"]
    inertia = beam["width"] * beam["thickness"] ** 3 / 12.0
    stiffness = beam["young_modulus"] * inertia / (beam["length"] / data["elements"][0])
    model = mujoco.MjModel.from_xml_string(_document(problem, False, stiffness, 0.0))
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, state, mass)
    first = np.sqrt(stiffness * np.linalg.eigvalsh(np.linalg.inv(mass)).min())
    wanted = 2.0 * np.pi * problem.full(ball=False).first_frequency
    stiffness *= (wanted / first) ** 2
    return float(stiffness), float(2.0 * data["rayleigh"]["ratio"] / wanted * stiffness)


def history(problem, task, frequency, duration, setting):
    """The tip after every step of `setting` seconds."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(_document(problem, task.ball, *_calibrated(problem)))
    model.opt.timestep = setting
    state = mujoco.MjData(model)
    steps, omega = round(duration / setting), 2.0 * np.pi * frequency
    falling = problem.amplitude * omega**2 * np.sin(omega * setting * np.arange(steps + 1))
    gap, wall = problem.data["ball"]["gap"], problem.data["wall"]
    c, k = wall["damping"], wall["stiffness"]
    tips = np.empty(steps)
    gravity, place, speed, push, site = (
        model.opt.gravity,
        state.qpos,
        state.qvel,
        state.qfrc_applied,
        state.site_xpos[0],
    )
    step = mujoco.mj_step
    for n in range(steps):
        gravity[2] = falling[n]
        if task.ball:
            x = place[-1]
            if abs(x) > gap:
                depth, rate = abs(x) - gap, speed[-1] if x > 0 else -speed[-1]
                # the dashpot may take the spring's force away, no more
                force = max(c * rate, -k * depth)
                push[-1] = -force if x > 0 else force
            else:
                push[-1] = 0.0
        step(model, state)
        tips[n] = site[2]
    return setting * np.arange(1, steps + 1), tips
