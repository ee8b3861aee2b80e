"""Time of a step of each drive controller and of the simulated joint, beside peers: `make bench`.

Peers: python-control's own update of the same sampled system (dynamics and output), and
scipy.integrate.solve_ivp (DOP853, rtol 1e-12) through one sample of the same joint without
friction. Medians over repeats; machines share their cores, so read the ratios, and the first line
for the speed of the interpreter itself.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.timing import interpreter_line, median_s
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.run.joint.controllers import CONTROLLERS, lqg
from rig.studies.servo import bench
from rig.studies.servo.spec import ServoSpec, read_spec

STEPS = 2000
AHEAD = [MotorSetpoint(0.1 * k, 100.0, 10.0) for k in range(STEPS)]


def main() -> None:
    """Measure and print."""
    spec = read_spec(None)
    print(interpreter_line(), end="\n\n")
    print(f"{'controller':14s}{'us a step':>10s}")
    for name, design in CONTROLLERS.items():
        print(f"{name:14s}{_step_s(design(spec).controller) * 1e6:10.2f}")
    own, peer = _step_s(lqg(spec).controller), _python_control_s(spec)
    print(
        f"\nlqg, one step: {own * 1e6:.2f} us; the same system by python-control "
        f"{peer * 1e6:.1f} us: {peer / own:.0f} times"
    )
    for truth in spec.truth:
        print(
            f"joint, one sample of {spec.drive.period_s * 1e3:g} ms, plant variant {truth}: "
            f"{_sample_s(spec, truth) * 1e6:.1f} us"
        )
    own, peer = _sample_s(spec, "listed"), _solve_ivp_s(spec)
    print(
        f"solve_ivp through the same sample of the listed joint: {peer * 1e6:.0f} us: "
        f"{peer / own:.0f} times"
    )


def _step_s(controller: DriveController) -> float:
    def steps() -> None:
        controller.reset()
        for setpoint in AHEAD:
            controller.step(setpoint, setpoint.angle_rad)

    return median_s(steps, 15) / STEPS


def _python_control_s(spec: ServoSpec) -> float:
    system = lqg(spec).controller.system
    state, told = np.zeros(system.nstates), np.array([1.0, 100.0, 10.0, 1.0])

    def both() -> None:
        system.output(0.0, state, told)
        system.dynamics(0.0, state, told)

    return median_s(both, 500)


def _sample_s(spec: ServoSpec, truth: str) -> float:
    joint, torques = (
        bench.elastic_joint(spec.plant_variant_tables(truth), 1),
        itertools.cycle((0.5, 0.9, -0.2)),
    )

    def samples() -> None:
        for _ in range(200):
            joint.advance(next(torques), spec.drive.period_s)
            joint.read()

    return median_s(samples, 15) / 200


def _solve_ivp_s(spec: ServoSpec) -> float:
    a, b = spec.joint.state_matrix, spec.joint.input_matrix[:, 0]
    state = np.array([1.0, 100.0, 0.9, 99.0])
    span = (0.0, spec.drive.period_s)
    return median_s(
        lambda: solve_ivp(
            lambda _, x: a @ x + b * 0.5, span, state, method="DOP853", rtol=1e-12, atol=1e-12
        ),
        50,
    )


if __name__ == "__main__":
    main()
