"""Controllers of a comparison by name, each designed for the modelled joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rig.drives.servo.cascade import Cascade, CascadeController
from rig.drives.servo.disturbance_design import ObserverDesign
from rig.drives.servo.disturbance_observer import Compensated, DisturbanceObserver
from rig.drives.servo.errors import ServoError
from rig.drives.servo.estimator import Estimator, Noise, SampledEstimator, sampled_kalman
from rig.drives.servo.estimator import assign as assign_estimator
from rig.drives.servo.feed_forward import LoadFilter, min_relative_degree
from rig.drives.servo.loops import PolePair, oscillatory_pairs
from rig.drives.servo.lqg import StateSpaceController
from rig.drives.servo.nominal import LowPass, Nominal
from rig.drives.servo.notch import Notch
from rig.drives.servo.setpoint import DriveController, MotorSetpoint
from rig.drives.servo.shaped_setpoint import ShapedSetpoint, design_shaper
from rig.drives.servo.state_feedback import Feedback, assign, lq
from rig.drives.servo.wiring import ControlLoop
from rig.run.joint.friction_option import compensate_friction
from rig.run.joint.sections import JointDesign

FILTER_DONE_SHARE = 1e-3  # band of the settling time of a filter, share of the step


class Drive(NamedTuple):
    """Controller with its intended delay, the part of it in the loop, and a tuning note.

    loop_controller is None if all of it is in the loop.
    """

    controller: DriveController
    delay_s: float = 0.0
    loop_controller: DriveController | None = None
    note: str = ""

    @property
    def loop(self) -> Any:
        """System that closes the loop, see DriveController."""
        return (self.loop_controller or self.controller).system


class Shaped:
    """DriveController with an input shaper; a DriveController itself."""

    def __init__(self, shaper: ShapedSetpoint, controller: DriveController) -> None:
        self._shaper, self._controller = shaper, controller

    def step(self, setpoint: MotorSetpoint, motor_angle_rad: float) -> float:
        """Compute the torque [N m] for the shaped setpoint."""
        return self._controller.step(self._shaper.step(setpoint), motor_angle_rad)

    def reset(self) -> None:
        """Set the state to rest at angle 0."""
        self._shaper.reset()
        self._controller.reset()

    @property
    def system(self) -> Any:
        """System of the controller alone, as the shaper is outside of the loop."""
        return self._controller.system


def pid(spec: JointDesign) -> Drive:
    """Build P on the position, PI on the speed and speed feed-forward: PID of source 001."""
    controller = CascadeController(_cascade(spec), spec.drive.period_s)
    return Drive(compensate_friction(spec, controller))


def pid_ff(spec: JointDesign) -> Drive:
    """Build pid with torque feed-forward of the rigid inertia.

    The state-space controllers have it too.
    """
    inertia = spec.pid.feed_forward * spec.joint.rigid_inertia_kg_m2
    cascade = replace(_cascade(spec), feed_forward_inertia_kg_m2=inertia)
    controller = CascadeController(cascade, spec.drive.period_s)
    return Drive(compensate_friction(spec, controller))


def pid_notch(spec: JointDesign) -> Drive:
    """Build pid with a notch upstream of the speed loop, on its least damped pair."""
    cascade = _cascade(spec)
    pair = _least_damped("pid_notch", cascade.speed_loop(spec.joint))
    notch = Notch.tuned_to(pair, spec.compensators.notch_damping)
    note = (
        f"a notch at {pair.frequency_rad_s:.1f} rad/s, damping {pair.damping:.3f}, "
        "upstream of the speed loop"
    )
    controller = CascadeController(cascade, spec.drive.period_s, notch, "upstream")
    return Drive(compensate_friction(spec, controller), note=note)


def pid_observer(spec: JointDesign) -> Drive:
    """Build pid with a torque disturbance observer; nominal model: the motor alone."""
    low_pass = LowPass(time_constant_s=spec.compensators.observer_time_s)
    observer = ObserverDesign(low_pass=low_pass, nominal=Nominal.motor_alone(spec.joint))
    inner = CascadeController(_cascade(spec), spec.drive.period_s)
    compensated = Compensated(
        inner, DisturbanceObserver(observer, spec.drive.period_s), spec.drive.torque_limit_n_m
    )
    time_ms = 1e3 * spec.compensators.observer_time_s
    controller = compensate_friction(spec, compensated)
    return Drive(controller, note=f"T_f = {time_ms:g} ms, nominal model: the motor alone")


def pid_shaped(spec: JointDesign) -> Drive:
    """Build pid with a shaper for the least damped pair of the position loop."""
    cascade, period_s = _cascade(spec), spec.drive.period_s
    pair = _least_damped("pid_shaped", cascade.position_loop(spec.joint))
    shaper = design_shaper(spec.compensators.shaper, [pair], period_s)
    inner = compensate_friction(spec, CascadeController(cascade, period_s))
    note = (
        f"{spec.compensators.shaper} for {pair.frequency_rad_s:.1f} rad/s, damping "
        f"{pair.damping:.3f}, the least damped pair of the position loop"
    )
    return Drive(
        Shaped(ShapedSetpoint(shaper, period_s), inner), float(shaper.times_s[-1]), note=note
    )


def assigned(spec: JointDesign) -> Drive:
    """Build state feedback and Luenberger observer by assigned eigenvalues.

    With rigid feed-forward.
    """
    a, period_s = spec.assigned, spec.drive.period_s
    feedback = assign(spec.joint, [complex(*pole) for pole in a.poles_1_s], period_s)
    estimator = assign_estimator(
        spec.joint, [complex(*pole) for pole in a.estimator_poles_1_s], period_s
    )
    return Drive(compensate_friction(spec, _state_space(spec, feedback, estimator, "rigid")))


def lqg(spec: JointDesign) -> Drive:
    """Build LQ feedback and Kalman filter, with rigid feed-forward."""
    controller = _state_space(spec, *_optimal(spec), "rigid")
    return Drive(compensate_friction(spec, controller))


def lqg_ff(spec: JointDesign) -> Drive:
    """Build lqg with the feed-forward pair C1, C2: the load follows the filter F0."""
    import control

    load_filter = LoadFilter.binomial(min_relative_degree(spec.joint), spec.lqg.corner_rad_s)
    controller = _state_space(spec, *_optimal(spec), "dynamic", load_filter)
    note = f"F0 = 1 / (1 + s / {spec.lqg.corner_rad_s:g})^{load_filter.relative_degree}"
    controller = compensate_friction(
        spec, controller, control.tf(load_filter.numerator, load_filter.denominator)
    )
    return Drive(controller, _settling_s(load_filter), lqg(spec).controller, note)


CONTROLLERS: dict[str, Callable[[JointDesign], Drive]] = {
    "pid": pid,
    "pid_ff": pid_ff,
    "pid_notch": pid_notch,
    "pid_observer": pid_observer,
    "pid_shaped": pid_shaped,
    "assigned": assigned,
    "lqg": lqg,
    "lqg_ff": lqg_ff,
}


def _cascade(spec: JointDesign) -> Cascade:
    p = spec.pid
    limit = spec.drive.torque_limit_n_m
    return Cascade.normalised(
        spec.joint, p.speed_crossover, p.position_crossover, p.reset_time, torque_limit_n_m=limit
    )


def _least_damped(name: str, loop: ControlLoop) -> PolePair:
    pair = min(
        oscillatory_pairs(loop.analysis.poles_1_s), key=lambda mode: mode.damping, default=None
    )
    if pair is None:
        raise ServoError(
            f"{name} on a loop that does not oscillate; must have a complex pole pair: "
            f"remove {name} from --controllers"
        )
    return pair


def _optimal(spec: JointDesign) -> tuple[Feedback, SampledEstimator]:
    g = spec.lqg
    noise = Noise(
        motor_torque_n2_m2_s=g.torque_noise_n2_m2_s,
        load_torque_n2_m2_s=g.torque_noise_n2_m2_s,
        encoder_counts_per_rev=g.encoder_counts_per_rev,
    )
    return lq(spec.joint, g.state_weights, g.torque_weight), sampled_kalman(
        spec.joint, noise, spec.drive.period_s
    )


def _state_space(
    spec: JointDesign,
    feedback: Feedback,
    estimator: Estimator | SampledEstimator,
    feed_forward: str,
    load_filter: LoadFilter | None = None,
) -> DriveController:
    return StateSpaceController(
        spec.joint,
        feedback,
        estimator,
        spec.drive.period_s,
        torque_limit_n_m=spec.drive.torque_limit_n_m,
        feed_forward=feed_forward,
        load_filter=load_filter,
    )


def _settling_s(load_filter: LoadFilter) -> float:
    """Compute the settling time of a step through the filter, band FILTER_DONE_SHARE."""
    import control

    slowest = -max(root.real for root in np.roots(load_filter.denominator))
    t = np.linspace(0.0, 30.0 / slowest, 3001)
    system = control.tf(load_filter.numerator, load_filter.denominator)
    step = control.step_response(system, t).outputs
    last_outside = np.flatnonzero(np.abs(step - 1.0) > FILTER_DONE_SHARE)[-1]
    return float(t[last_outside + 1])
