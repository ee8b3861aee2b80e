"""Step response of the robot: the setpoints of the drives step, the encoders answer.

The experiment loop sends no step: its gates refuse it. So the step is given where the source gave
it, at the input of the robot. Encoders are read every 5 ms; five steps at instants 1 ms apart
give a reading every millisecond.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from comms.messages import JointState
from comms.task import Task
from rig.errors import RunFailed
from rig.run import config
from rig.run.runtime import bench
from rig.run.tasks.controller.joints import RobotJoints, RobotSettings, robot_joints
from rig.studies.source_004.rule import BasisValue, RunFigures

ROBOT_STEP = "robot_step"  # in place of an experiment
EXPERIMENT = "move"  # whose robot is tried
STEP_M = 0.01
MS = 1_000_000
SETPOINT_NS = 100 * MS  # instant of the first step
WATCH_NS = 250 * MS
READ_NS = 5 * MS
LOW, HIGH = 0.1, 0.9  # rise time between these shares of the step
RISE_TO_BANDWIDTH = 0.35  # bandwidth times rise time, first order
FloatArray = npt.NDArray[np.float64]


class StepResponse(NamedTuple):
    """Position as a share of the step, over the time since the step."""

    t_s: FloatArray  # (N,)
    share: FloatArray  # (N,)


class SecondOrder(NamedTuple):
    """Fit of a delayed second order: natural frequency, damping ratio, delay, deviation."""

    natural_rad_s: float
    damping: float
    delay_s: float
    rms: float  # of the residuals, share of the step


def robot_step() -> RunFigures:
    """Measure the response of the robot of the shipped move. Raises RunFailed."""
    response = measure()
    rise_s = rise_time_s(response)
    fit = fit_second_order(response)
    values = {
        "rise_time": rise_s,
        "bandwidth": RISE_TO_BANDWIDTH / rise_s,
        "fit_deviation": fit.rms,
        "fit_natural_frequency": fit.natural_rad_s,
        "fit_damping": fit.damping,
    }
    measured = {name: {"encoders": BasisValue(value=value)} for name, value in values.items()}
    return RunFigures(experiment=ROBOT_STEP, values=measured)


def measure() -> StepResponse:
    """Step the setpoints of the robot along x, at five instants. Raises RunFailed."""
    chosen = config.read_experiment(EXPERIMENT, ["camera.rate_hz=0"])
    plant = bench.plant(chosen)
    settings = msgspec.structs.replace(plant.settings, input=None)  # no gate before the drives
    joints = robot_joints(RobotSettings(kinematics=plant.kinematics))
    rows: list[tuple[float, float]] = []
    for phase in range(READ_NS // MS):
        rows += _one_step(bench.task(settings), joints, SETPOINT_NS + phase * MS)
    t_s, x_m = np.array(sorted(rows)).T
    return StepResponse(t_s, x_m / STEP_M)


def rise_time_s(response: StepResponse) -> float:
    """Find the time from 10 to 90 % of the step."""
    ends = [_crossing_s(response, level) for level in (LOW, HIGH)]
    return ends[1] - ends[0]


def fit_second_order(response: StepResponse) -> SecondOrder:
    """Fit w^2 / (s^2 + 2 zeta w s + w^2) with a delay to the response, 0 < zeta < 1."""

    def residuals(p: FloatArray) -> FloatArray:
        return second_order(response.t_s, *p) - response.share

    bounds = ([1.0, 0.05, 0.0], [1000.0, 0.999, 0.05])
    found: Any = least_squares(residuals, [70.0, 0.9, 0.002], bounds=bounds)
    omega, zeta, delay_s = (float(one) for one in found.x)
    return SecondOrder(omega, zeta, delay_s, float(np.sqrt(np.mean(found.fun**2))))


def second_order(t_s: FloatArray, omega_rad_s: float, zeta: float, delay_s: float) -> FloatArray:
    """Compute the unit step response of a second order behind a delay: (N,)."""
    since_s = np.maximum(t_s - delay_s, 0.0)
    root = np.sqrt(1.0 - zeta**2)
    turned = omega_rad_s * root * since_s
    decay = np.exp(-zeta * omega_rad_s * since_s)
    return np.asarray(1.0 - decay * (np.cos(turned) + zeta / root * np.sin(turned)))


def _crossing_s(response: StepResponse, level: float) -> float:
    first = int(np.argmax(response.share >= level))
    if first == 0:
        raise RunFailed(f"the robot did not reach {level:.0%} of its step: look at its limits")
    below, above = response.share[first - 1], response.share[first]
    start, end = response.t_s[first - 1], response.t_s[first]
    return float(start + (level - below) / (above - below) * (end - start))


def _one_step(task: Task, joints: RobotJoints, step_ns: int) -> list[tuple[float, float]]:
    """Run one step; list time since it and position, from the encoders."""
    rows = []
    task.start(0)
    for k, (t_ns, x_m) in enumerate([(0, 0.0), (step_ns, STEP_M)]):
        rows += _readings(task.on_tick(t_ns).sends, joints)
        task.on_message("setpoint", joints.setpoint(k, t_ns, (x_m, 0.0, 0.0)), t_ns)
    for t_ns in range(step_ns - step_ns % READ_NS + READ_NS, step_ns + WATCH_NS, READ_NS):
        rows += _readings(task.on_tick(t_ns).sends, joints)
    return [((t_ns - step_ns) * 1e-9, x_m) for t_ns, x_m in rows if t_ns >= step_ns]


def _readings(sends: Any, joints: RobotJoints) -> list[tuple[int, float]]:
    rows = []
    for send in sends:
        if isinstance(send.message, JointState):
            platform = joints.platform(send.message)
            if platform is not None:
                rows.append((platform.t_ns, platform.position_m[0]))
    return rows
