"""Choice of a planner for a cable whose length is known to a standard deviation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from planners import catalog
from planners.errors import PlanError
from planners.models.pendulum import PendulumModel
from planners.problem import Limits, Problem
from planners.replay.wrong_parameters import residual_curve

SIGMAS = (-2.0, -1.0, 0.0, 1.0, 2.0)
GOOD_RESIDUAL_RAD = 0.3e-3  # as small as the residual swing of a good plan
PERIODS = 1.25  # duration of the move; ZVD alone takes one period
MIN_SHARE = 0.05  # of the length, that is left at the lower end


class Candidate(NamedTuple):
    """Planner with the parameters to whose error it is robust."""

    planner: str
    robust: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Options of `rig plan`."""
        robust = f" --robust {','.join(self.robust)}" if self.robust else ""
        return f"--planner {self.planner}{robust}"


CANDIDATES = (
    Candidate("matrix_exponential"),
    Candidate("zv"),
    Candidate("zvd"),
    Candidate("matrix_exponential", ("length",)),
)


class CandidateRow(NamedTuple):
    """Residual swing of a candidate at the lengths of SIGMAS."""

    candidate: Candidate
    residual_rad: tuple[float, ...]

    @property
    def worst_rad(self) -> float:
        """Largest residual swing."""
        return max(self.residual_rad)


class RobustChoice(NamedTuple):
    """Candidates, and the simplest one that is good over the whole interval."""

    distance_m: float
    time_s: float
    lengths_m: tuple[float, ...]
    rows: tuple[CandidateRow, ...]
    chosen: CandidateRow


def choose_planner(
    length_m: float,
    sigma_m: float,
    damping_ratio: float,
    *,
    distance_m: float = 0.2,
    time_s: float | None = None,
    limits: Limits | None = None,
) -> RobustChoice:
    """Compare planners over the length +- 2 sigma; time_s None: 1.25 periods of the cable.

    The chosen one is the first of CANDIDATES whose residual swing stays below GOOD_RESIDUAL_RAD,
    or the one with the smallest. A plan that exceeds a limit is left out. Raises PlanError if none
    is left.
    """
    model = PendulumModel(length_m=length_m, damping_ratio=max(0.0, damping_ratio))
    period_s = 2.0 * np.pi * np.sqrt(length_m / model.gravity_m_s2)
    duration_s = float(PERIODS * period_s) if time_s is None else time_s
    steps_m = np.asarray(SIGMAS) * sigma_m
    lengths_m = np.maximum(length_m + steps_m, MIN_SHARE * length_m)
    rows = []
    failure: PlanError | None = None
    for candidate in CANDIDATES:
        problem = Problem(
            distance_m=distance_m,
            time_s=duration_s,
            model=model,
            robust=candidate.robust,
            limits=limits or Limits(),
        )
        try:
            made = catalog.plan(candidate.planner, problem)
        except PlanError as error:
            failure = error
            continue
        if made.reasons:
            failure = PlanError(f"the plan exceeds a limit: {'; '.join(made.reasons)}")
            continue
        residual_rad = residual_curve(model, made.motion.x, "length", lengths_m)
        rows.append(CandidateRow(candidate, tuple(residual_rad.tolist())))
    if not rows:
        assert failure is not None
        raise failure
    good = [row for row in rows if row.worst_rad <= GOOD_RESIDUAL_RAD]
    chosen = good[0] if good else min(rows, key=lambda row: row.worst_rad)
    return RobustChoice(distance_m, duration_s, tuple(lengths_m.tolist()), tuple(rows), chosen)
