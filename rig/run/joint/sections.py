"""Tables of a drive on an elastic joint: move, model, and the gains of every controller.

Shared by comparison files (`rig servo compare`) and experiment files (`[joint]`).
"""

from __future__ import annotations

import math
from typing import Annotated, Protocol

import msgspec
from msgspec import Meta

from planners.laws.trapezoidal import trapezoidal_by_acceleration
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.two_mass import TwoMass
from rig.errors import ConfigError
from rig.run.drive_section import JointNodeSection
from rig.run.toml_file import Section

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e12)]
Share = Annotated[float, Meta(gt=0, le=1e3)]


class TrapezoidSection(Section, frozen=True, kw_only=True):
    """`[[move]]`, `[joint.move]`: trapezoidal speed, from rest to rest.

    Raises ValueError for an angle of 0.
    """

    load_angle_deg: Annotated[float, Meta(ge=-1e6, le=1e6)]
    time_s: Annotated[float, Meta(gt=0, le=60)]
    motor_acceleration_rad_s2: Positive

    def __post_init__(self) -> None:
        if not self.load_angle_deg:
            raise ValueError(
                "load_angle_deg = 0 is no move; must not be 0: give an angle, its sign is the "
                "direction"
            )

    @property
    def title(self) -> str:
        """Title of the move in tables."""
        return f"{self.load_angle_deg:g}° in {self.time_s:g} s"

    def trajectory(self, gear_ratio: float, table: str = "[[move]]") -> Trajectory:
        """Build the trajectory of the motor angle [rad].

        Raises ConfigError for an acceleration that is too low for the time.
        """
        angle_rad = math.radians(self.load_angle_deg) * gear_ratio
        least = 4.0 * abs(angle_rad) / self.time_s**2
        if self.motor_acceleration_rad_s2 < least * (1.0 - 1e-12):
            raise ConfigError(
                f"{table} motor_acceleration_rad_s2 = {self.motor_acceleration_rad_s2:g} for "
                f"{self.title} with a gear ratio of {gear_ratio:g}; must be >= {least:.6g}: raise "
                "it, or raise time_s"
            )
        return trapezoidal_by_acceleration(
            angle_rad, self.time_s, self.motor_acceleration_rad_s2
        ).trajectory()


class JointModelSection(Section, frozen=True, kw_only=True):
    """`[model]`, `[joint.model]`: model of the joint for the design of the controllers.

    See rig.drives.servo.two_mass.TwoMass.
    """

    motor_inertia_kg_m2: float
    load_inertia_kg_m2: float
    stiffness_n_m_rad: float
    gear_ratio: float = 1.0
    motor_friction_n_m_s_rad: float = 0.0
    load_friction_n_m_s_rad: float = 0.0
    elastic_damping_n_m_s_rad: float = 0.0


class PidSection(Section, frozen=True, kw_only=True):
    """`[pid]`: P on the position, PI on the speed.

    Gains in shares of omega_z; the reset time in 1 / omega_z.
    """

    speed_crossover: Share = 0.7
    position_crossover: Share = 0.15
    reset_time: Share = 10.0
    # of pid_ff: share of the rigid inertia in its torque feed-forward
    feed_forward: Annotated[float, Meta(ge=0, le=10)] = 1.0


class LqgSection(Section, frozen=True, kw_only=True):
    """`[lqg]`: weights, noise model of the Kalman filter, corner of the load filter.

    Weights of [qm, qm', n ql, n ql', integral of the error] and of the torque.
    """

    state_weights: tuple[NotNegative, NotNegative, NotNegative, NotNegative, NotNegative] = (
        50.0,
        0.0,
        50.0,
        0.001,
        20000.0,
    )
    torque_weight: Positive = 1.0
    # density of white torques on motor and load: 0.05 N m, a new value each ms
    torque_noise_n2_m2_s: Positive = 2.5e-6
    encoder_counts_per_rev: Annotated[int, Meta(ge=1, le=2**40)] = 8192
    corner_rad_s: Positive = 150.0  # of the load filter in lqg_ff


class AssignedSection(Section, frozen=True, kw_only=True):
    """`[assigned]`: eigenvalues, as pairs of real and imaginary part.

    Both of a conjugate pair.
    """

    poles_1_s: tuple[tuple[float, float], ...] = (
        (-60.0, 60.0),
        (-60.0, -60.0),
        (-105.0, 105.0),
        (-105.0, -105.0),
        (-40.0, 0.0),
    )
    estimator_poles_1_s: tuple[tuple[float, float], ...] = (
        (-400.0, 400.0),
        (-400.0, -400.0),
        (-300.0, 100.0),
        (-300.0, -100.0),
    )


class CompensatorsSection(Section, frozen=True, kw_only=True):
    """`[compensators]`: blocks added to a P/PI cascade, and friction compensation.

    The blocks are those of pid_notch, pid_observer and pid_shaped; the friction compensation is
    that of every controller, see rig.drives.servo.friction.
    """

    notch_damping: Share = 1.0  # damping ratio of its poles
    # the load oscillates with shorter ones in this cascade: damping ratio 0.10 at 5 ms
    observer_time_s: Positive = 0.02
    shaper: str = "zv"
    friction_compensation: bool = False
    friction_torque_share: Annotated[float, Meta(gt=0, le=1)] = 0.1  # of the torque limit
    friction_time_s: Positive = 0.05  # time constant of the adaptation
    friction_deadband_rad_s: Positive = 5.0  # of the motor's speed; 8192 counts at 1 ms: 0.8 rad/s


class SampledDrive(Protocol):
    """Sample time and torque limit of a drive."""

    @property
    def period_s(self) -> float:
        """Sample time."""

    @property
    def torque_limit_n_m(self) -> float:
        """Torque limit of the controller; inf for none."""


class JointDesign(Protocol):
    """Model, drive and gains for the design of the controllers of an elastic joint."""

    @property
    def joint(self) -> TwoMass:
        """Model of the joint."""

    @property
    def drive(self) -> SampledDrive:
        """Sample time and torque limit."""

    @property
    def pid(self) -> PidSection:
        """Gains of the cascades."""

    @property
    def lqg(self) -> LqgSection:
        """Weights and noise of the optimal controllers."""

    @property
    def assigned(self) -> AssignedSection:
        """Eigenvalues of the assigned controller."""

    @property
    def compensators(self) -> CompensatorsSection:
        """Blocks added to a controller."""


class JointGains(Section, frozen=True, kw_only=True):
    """Model of the joint with the gains of every controller."""

    model: JointModelSection
    pid: PidSection = PidSection()
    lqg: LqgSection = LqgSection()
    assigned: AssignedSection = AssignedSection()
    compensators: CompensatorsSection = CompensatorsSection()

    @property
    def joint(self) -> TwoMass:
        """Model of the joint; raises ServoError for a value out of bounds."""
        return TwoMass(**msgspec.structs.asdict(self.model))


class JointSection(JointGains, frozen=True, kw_only=True):
    """`[joint]` of an experiment: controller, move and drive; see rig.run.joint.controllers."""

    controller: str = "pid"
    move: TrapezoidSection
    drive: JointNodeSection = JointNodeSection()
