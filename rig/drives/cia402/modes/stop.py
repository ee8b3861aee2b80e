"""Stop ramp of quick stop and fault reaction."""

from __future__ import annotations

from rig.drives.cia402.axis import DriveAxis
from rig.drives.cia402.ramp import RampMotion, plan_stop
from rig.drives.cia402.signals import NS_PER_MS, NS_PER_S, DemandKind, DriveDemand

VELOCITY_THRESHOLD = 0x606F
VELOCITY_THRESHOLD_TIME = 0x6070  # [ms]


class StopRamp:
    """Deceleration from the demanded velocity to rest, then holding."""

    def __init__(self, axis: DriveAxis, deceleration: float, *, controls_position: bool) -> None:
        """Stop the axis with a deceleration > 0 [increments/s^2].

        With controls_position the demand is a position, else a velocity.
        """
        self._axis = axis
        self._controls_position = controls_position
        self._motion: RampMotion = plan_stop(axis.position, axis.velocity, deceleration)
        self._start_ns = axis.demand_t_ns
        self._rest_ns: int | None = None  # first sample with a demand at rest

    def step(self) -> DriveDemand:
        """Compute the demand of this sample."""
        axis = self._axis
        t_s = (axis.t_ns - self._start_ns) / NS_PER_S
        point = self._motion.at(t_s)
        if t_s >= self._motion.duration_s:
            return self._rest()
        if self._controls_position:
            axis.position = point.position
        else:
            axis.follow_actual()
        axis.velocity = point.velocity
        kind: DemandKind = "position" if self._controls_position else "velocity"
        return axis.demand(kind, point.acceleration)

    @property
    def is_finished(self) -> bool:
        """True when the axis rests: slower than 606F, or 6070 after the end of the ramp."""
        if self._rest_ns is None:
            return False
        axis = self._axis
        waited_ns = axis.t_ns - self._rest_ns
        if waited_ns >= axis.dictionary.get(VELOCITY_THRESHOLD_TIME) * NS_PER_MS:
            return True
        return abs(axis.actual_velocity) <= axis.velocity_of(VELOCITY_THRESHOLD)

    def _rest(self) -> DriveDemand:
        axis = self._axis
        if self._rest_ns is None:
            self._rest_ns = axis.t_ns
            axis.position = axis.actual_position
            if self._controls_position:
                axis.position = self._motion.target
        axis.velocity = 0.0
        return axis.demand("brake")
