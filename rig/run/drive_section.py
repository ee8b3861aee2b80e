"""The tables `[can]` and `[drive]` of an experiment: field bus, and what the drive is told.

`[drive]` is the belief about the axis, from which the controller of the drive is designed; the
simulated axis itself is `[bench.robot]` with kind = "ball_screw".
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from rig.run.toml_file import Section

Positive = Annotated[float, Meta(gt=0, le=1e12)]
NotNegative = Annotated[float, Meta(ge=0, le=1e9)]


class CanSection(Section, frozen=True, kw_only=True):
    """`[can]`: interface of python-can; auto = a simulated bus between the processes."""

    interface: str = "auto"
    channel: str = ""
    bitrate: Annotated[int, Meta(ge=10_000, le=1_000_000)] = 1_000_000


class AxisDriveSection(Section, frozen=True, kw_only=True):
    """`[drive]`: node, controller, and the model of the axis that the controller is designed for.

    Defaults: the screw 20 x 20 of source 004 with a table of 10 kg.
    """

    node_id: Annotated[int, Meta(ge=1, le=126)] = 1
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
    # of node and master; two missing ones stop the axis, three end the run
    heartbeat_ms: Annotated[int, Meta(ge=10, le=1000)] = 20
    following_error_mm: Positive = 5.0  # of the drive itself

    @property
    def tau_m_rad(self) -> float:
        """Travel per angle of the screw [m/rad]."""
        return self.lead_m / (2.0 * math.pi)

    @property
    def increments_per_m(self) -> float:
        """Increments of the encoder per metre."""
        return self.encoder_counts_per_rev / self.lead_m


class NodeSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Settings of the bench of a run with a drive."""

    drive: AxisDriveSection
    plant: dict[str, Any]  # of the simulated plant, see rig/run/runtime/bench.py
