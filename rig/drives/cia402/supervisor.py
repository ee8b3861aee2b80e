"""Supervision of the motion: following error, end switches and software position limits."""

from __future__ import annotations

from rig.drives.cia402.axis import DriveAxis
from rig.drives.cia402.signals import NS_PER_MS

FOLLOWING_WINDOW = 0x6065
FOLLOWING_TIME_OUT = 0x6066  # [ms]
FOLLOWING_ERROR = 0x60F4

WINDOW_OFF = 0xFFFF_FFFF


class AxisSupervisor:
    """Comparison of each measurement with the demand of the sample before it."""

    def __init__(self, axis: DriveAxis) -> None:
        """Supervise an axis."""
        self._axis = axis
        self.reset()

    def reset(self) -> None:
        """Forget a following error."""
        self.has_following_error = False
        self._outside_since_ns: int | None = None

    def restart(self) -> None:
        """Start the time-out of the following error anew."""
        self._outside_since_ns = None
        self._axis.dictionary.set(FOLLOWING_ERROR, 0)

    def check_following(self) -> bool:
        """Tell if the following error is beyond 6065 for the time 6066; report it in 60F4."""
        axis = self._axis
        error = axis.position - axis.actual_position
        axis.dictionary.set(FOLLOWING_ERROR, round(error))
        window = axis.dictionary.get(FOLLOWING_WINDOW)
        if window == WINDOW_OFF or abs(error) <= window:
            self._outside_since_ns = None
            return False
        if self._outside_since_ns is None:
            self._outside_since_ns = axis.t_ns
        outside_ns = axis.t_ns - self._outside_since_ns
        time_out_ns = axis.dictionary.get(FOLLOWING_TIME_OUT) * NS_PER_MS
        self.has_following_error = outside_ns >= time_out_ns
        return self.has_following_error

    def moves_into_switch(self) -> bool:
        """Tell if the axis moves towards an end switch that is active."""
        velocity = self._axis.velocity
        feedback = self._axis.feedback
        if velocity < 0.0:
            return feedback.negative_switch
        return velocity > 0.0 and feedback.positive_switch

    def moves_beyond_limit(self) -> bool:
        """Tell if the axis is beyond a software position limit and moves away from the range."""
        limits = self._axis.position_limits()
        if limits is None:
            return False
        low, high = limits
        velocity = self._axis.velocity
        position = self._axis.actual_position
        return (velocity < 0.0 and position < low) or (velocity > 0.0 and position > high)
