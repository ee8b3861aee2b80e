"""The tables `[robot]` and `[controller]` of an experiment: robot as believed, and its policy."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from rig.run.toml_file import Section

Positive = Annotated[float, Meta(gt=0, le=1e6)]


class RobotSection(Section, frozen=True, kw_only=True):
    """`[robot]`: what the controller believes of the robot.

    kinematics: axes, or quattro: four joints in rad; auto: by the kind of [bench.robot].
    """

    kinematics: Literal["auto", "axes", "quattro"] = "auto"
    home_z_m: Annotated[float, Meta(ge=-10, le=10)] = -0.90  # home position over the base
    joint_speed_rad_s: Positive = 35.0  # bound of every joint, checked before a run


class ControllerSection(Section, frozen=True, kw_only=True):
    """`[controller]`: interpolator policy.

    bounded: setpoints keep the [safety] envelope whatever is lost; buffer: the same, playout_ms
    later and with gaps bridged; source: a gap in the references is made good in one window of
    30 ms, as in the source (simulated bench only).
    """

    policy: Literal["bounded", "buffer", "source"] = "bounded"
    playout_ms: Annotated[float, Meta(ge=10, le=1000)] = 100.0  # of the policy buffer
