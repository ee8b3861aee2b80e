"""Load whose motion is seen by a clock that does not keep true time."""

from __future__ import annotations

from sim_rig.link_angles import LinkState
from sim_rig.load import Load
from sim_rig.params import BenchParams
from sim_rig.vectors import Vector, scaled


class LoadInRunTime(Load):
    """Load in the time t_run = r t_true of the run, with r = 1 + clock_ppm 1e-6.

    It swings in true time: lengths, gravity, damping, pushes and changes of length are those of
    the parameters. The platform moves in run time, so what it hands over is converted, velocities
    by r and accelerations by r^2, and what comes back by the inverse. Hence a frequency f is seen
    at f / r, and a damping ratio as it is. Forces are mass times acceleration in run time.
    """

    def __init__(self, params: BenchParams) -> None:
        super().__init__(params)
        self._rate = params.clock_rate

    @property
    def links(self) -> list[LinkState]:
        """Angles of the links, and their rates per second of run time."""
        per_run_s = 1.0 / self._rate
        return [
            link._replace(
                rate_x_rad_s=link.rate_x_rad_s * per_run_s,
                rate_y_rad_s=link.rate_y_rad_s * per_run_s,
            )
            for link in super().links
        ]

    @property
    def angular_velocity_rad_s(self) -> float:
        """Rate of the first link in the plane x, per second of run time."""
        return self.links[0].rate_x_rad_s

    def start_run(self, in_s: float) -> None:
        """Set the start of the run, so many seconds of run time from now."""
        super().start_run(in_s / self._rate)

    def force_n(self, acceleration_m_s2: Vector) -> Vector:
        """Compute the force of the load on a pivot that accelerates so, both in run time."""
        square = self._rate**2
        return scaled(super().force_n(scaled(acceleration_m_s2, square)), 1.0 / square)

    def advance(
        self, step_s: float, vx_m_s: list[float], vy_m_s: list[float], vz_m_s: list[float]
    ) -> None:
        """Integrate (N - 1) / 2 steps of run time; velocities (N,) in run time. Raises LoadEvent.

        An instant in the text of an event is one of true time.
        """
        true_m_s = [[self._rate * v for v in each] for each in (vx_m_s, vy_m_s, vz_m_s)]
        super().advance(step_s / self._rate, *true_m_s)

    def advance_at_rest(self, step_s: float, steps: int) -> None:
        """Integrate steps of run time with the pivot at rest. Raises LoadEvent."""
        super().advance_at_rest(step_s / self._rate, steps)
