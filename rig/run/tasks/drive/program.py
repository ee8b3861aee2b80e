"""Program of a drive: targets on the grid of the SYNCs, from the start of the run on."""

from __future__ import annotations

from collections.abc import Sequence

from rig.run.tasks.drive.settings import ProgramStep


class Program:
    """Targets of a run; those of a joint, which has no controller between plan and drive."""

    def __init__(self, steps: Sequence[ProgramStep], period_ns: int) -> None:
        self._steps = steps
        self._period_ns = period_ns
        self._start_ns: int | None = None
        self._origin = 0

    def begin(self, t_start_ns: int, position: int) -> None:
        """Start at t_start_ns, from the position where the drive stands [increments]."""
        self._start_ns = t_start_ns
        self._origin = position - self._steps[0].position

    def step_at(self, t_ns: int) -> ProgramStep | None:
        """Return the target of the SYNC at t_ns; the last one is held. None before the start."""
        if self._start_ns is None or t_ns < self._start_ns:
            return None
        k = min((t_ns - self._start_ns) // self._period_ns, len(self._steps) - 1)
        step = self._steps[k]
        return step._replace(position=step.position + self._origin)
