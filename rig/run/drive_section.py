"""The tables `[can]` and `[drive]` of an experiment: field bus, and what the drive is told.

`[drive]` is the belief about the axis, from which the controller of the drive is designed; the
simulated axis itself is `[bench.robot]` with kind = "ball_screw".
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from rig.run.toml_file import Section

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e9)]
JOINT_SYNC_MS = 1
ACCELERATION_UNIT_RAD_S2 = 1e-6  # of object 2000, acceleration of the load of a joint


class CanSection(Section, frozen=True, kw_only=True):
    """`[can]`: interface of python-can; auto = a simulated bus between the processes."""

    interface: str = "auto"
    channel: str = ""
    bitrate: Annotated[int, Meta(ge=10_000, le=1_000_000)] = 1_000_000


class NodeSection(Section, frozen=True, kw_only=True):
    """Node of a drive: identity on the bus, torque, and reaction to a lost master."""

    node_id: Annotated[int, Meta(ge=1, le=126)] = 1
    rated_torque_n_m: Positive = 1.0
    torque_limit_n_m: Positive = 2.5
    # of node and master; two missing ones stop the axis, three end the run
    heartbeat_ms: Annotated[int, Meta(ge=10, le=1000)] = 20


class JointNodeSection(NodeSection, frozen=True, kw_only=True):
    """`[joint.drive]`: node of an elastic joint; it gets a target every millisecond.

    Angles, speeds and accelerations are those of the motor.
    """

    increments_per_rev: Annotated[int, Meta(ge=1000, le=2**24)] = 2**20  # of the targets
    quick_stop_rad_s2: Positive = 1000.0
    following_error_rad: Positive = 20.0  # of the drive itself
    position_limit_deg: Positive = 180.0  # of the load, to both sides

    @property
    def period_s(self) -> float:
        """Sample time of the controller in the node [s]."""
        return JOINT_SYNC_MS * 1e-3

    @property
    def sync_ms(self) -> int:
        """Period of the SYNC."""
        return JOINT_SYNC_MS

    @property
    def unit(self) -> str:
        """Unit of position on the bus, beside the increment."""
        return "rad"

    @property
    def increments_per_unit(self) -> float:
        """Increments on the bus per rad of the motor."""
        return self.increments_per_rev / (2.0 * math.pi)


class AxisDriveSection(NodeSection, frozen=True, kw_only=True):
    """`[drive]`: node, controller, and the model of the axis that the controller is designed for.

    Defaults: the screw 20 x 20 of source 004 with a table of 10 kg.
    """

    controller: Literal["cascade", "lqg"] = "cascade"
    sync_ms: Literal[1, 5] = 5
    lead_m: Positive = 0.02
    encoder_counts_per_rev: Annotated[int, Meta(ge=100, le=2**24)] = 10_000
    rotary_inertia_kg_m2: Positive = 1.5e-4
    moving_mass_kg: Positive = 10.65
    axial_stiffness_n_m: Positive = 3.54e7
    elastic_damping_ratio: Annotated[float, Meta(ge=0, lt=1)] = 0.03
    rated_torque_n_m: Positive = 1.27
    torque_limit_n_m: Positive = 3.8
    speed_loop_rad_s: Positive = 400.0  # crossover of the speed loop of the cascade
    position_loop_rad_s: Positive = 60.0  # crossover of its position loop
    quick_stop_m_s2: Positive = 20.0
    following_error_mm: Positive = 5.0  # of the drive itself

    @property
    def tau_m_rad(self) -> float:
        """Travel per angle of the screw [m/rad]."""
        return self.lead_m / (2.0 * math.pi)

    @property
    def unit(self) -> str:
        """Unit of position on the bus, beside the increment."""
        return "m"

    @property
    def increments_per_unit(self) -> float:
        """Increments of the encoder per metre."""
        return self.encoder_counts_per_rev / self.lead_m


DriveSection = AxisDriveSection | JointNodeSection
