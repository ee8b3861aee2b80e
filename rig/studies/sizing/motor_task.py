"""Motor task from a TOML file or a shipped example: motor, drivetrain and repeated motion."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

import msgspec

from planners.errors import unknown_name
from planners.laws import LAWS
from planners.laws.trapezoidal import trapezoidal_by_acceleration
from planners.trajectories.trajectory import Trajectory
from rig.drives.motor import Drivetrain, Motor
from rig.errors import ConfigError
from rig.run.toml_file import Section, convert

EXAMPLES = ("1", "2")  # worked tasks of source 000


class MotorSection(Section, frozen=True, kw_only=True):
    """`[motor]`: limits of the motor, as in its data sheet."""

    continuous_torque_n_m: float
    peak_torque_n_m: float
    max_speed_rad_s: float
    peak_power_w: float = float("inf")


class DrivetrainSection(Section, frozen=True, kw_only=True):
    """`[drivetrain]`: inertia and friction of motor and load, and the gear between them."""

    motor_inertia_kg_m2: float
    load_inertia_kg_m2: float = 0.0
    motor_friction_n_m_s_rad: float = 0.0
    load_friction_n_m_s_rad: float = 0.0
    gear_ratio: float = 1.0
    radius_m: float | None = None


class MotionSection(Section, frozen=True, kw_only=True):
    """`[motion]`: motion from rest to rest, in rad of the output shaft or in m."""

    time_s: float
    law: str = "cycloidal"
    distance_rad: float | None = None
    distance_m: float | None = None
    acceleration_rad_s2: float | None = None
    acceleration_m_s2: float | None = None
    rest_s: float = 0.0


class PublishedSection(Section, frozen=True, kw_only=True):
    """`[published]`: figures that a source prints of the task, and why they may differ."""

    rms_torque_n_m: float | None = None
    peak_speed_rad_s: float | None = None
    reason: str = ""


class MotorTask(Section, frozen=True, kw_only=True):
    """Whole file of a motor task.

    motor, drivetrain and trajectory are the arguments of rig.drives.motor.check_motor.
    """

    motor_section: MotorSection = msgspec.field(name="motor")
    drivetrain_section: DrivetrainSection = msgspec.field(name="drivetrain")
    motion: MotionSection
    published: PublishedSection = PublishedSection()

    @property
    def motor(self) -> Motor:
        """Motor of the task. Raises PlanError for a value out of bounds."""
        return Motor(**msgspec.structs.asdict(self.motor_section))

    @property
    def drivetrain(self) -> Drivetrain:
        """Drivetrain of the task. Raises PlanError for a value out of bounds."""
        values = msgspec.structs.asdict(self.drivetrain_section)
        if values["radius_m"] is None:
            values["radius_m"] = 1.0
        return Drivetrain(**values)

    def trajectory(self) -> Trajectory:
        """Build the motion of the output shaft [rad], or of the load on its radius [m].

        Raises ConfigError for keys that exclude each other, PlanError for values that the law
        refuses.
        """
        m = self.motion
        distance, acceleration = self._metres() if m.distance_m is not None else self._radians()
        if m.law not in LAWS:
            raise unknown_name("[motion] law", m.law, LAWS)
        if acceleration is None:
            return LAWS[m.law](m.time_s).scaled(distance)
        if m.law != "trapezoidal":
            raise ConfigError(
                f"[motion] an acceleration of {acceleration:g} with law = {m.law!r}; "
                "needs 'trapezoidal': leave it out"
            )
        return trapezoidal_by_acceleration(distance, m.time_s, acceleration).trajectory()

    @property
    def has_figures(self) -> bool:
        """True if the task has published figures."""
        return self.published != PublishedSection()

    def _metres(self) -> tuple[float, float | None]:
        m = self.motion
        if m.distance_m is None or m.distance_rad is not None or m.acceleration_rad_s2 is not None:
            raise ConfigError(
                f"[motion] distance_m = {m.distance_m} beside a key in rad; must be one unit: "
                "drop the others"
            )
        if self.drivetrain_section.radius_m is None:
            raise ConfigError(
                f"[motion] distance_m = {m.distance_m} without [drivetrain] radius_m; must have "
                "one, in m (a screw: lead / 2 pi): add it, or give distance_rad"
            )
        return m.distance_m, m.acceleration_m_s2

    def _radians(self) -> tuple[float, float | None]:
        m = self.motion
        if m.distance_rad is None:
            raise ConfigError(
                "[motion] distance_rad: missing; add it, or distance_m (--angle or --distance)"
            )
        if m.acceleration_m_s2 is not None or self.drivetrain_section.radius_m is not None:
            raise ConfigError(
                f"[motion] distance_rad = {m.distance_rad} beside acceleration_m_s2 or radius_m; "
                "must be one unit: drop them, or give distance_m"
            )
        return m.distance_rad, m.acceleration_rad_s2


def example_tables(name: str) -> dict[str, Any]:
    """Return the tables of a shipped example. Raises PlanError for a name not in EXAMPLES."""
    if name not in EXAMPLES:
        raise unknown_name("--example", name, EXAMPLES)
    path = resources.files("rig.studies.sizing") / "motors" / f"example_{name}.toml"
    return tomllib.loads(path.read_text())


def task_of(tables: dict[str, Any]) -> MotorTask:
    """Build the task of a file's tables.

    Raises ConfigError naming section, key, value and bound.
    """
    return convert(tables, MotorTask)
