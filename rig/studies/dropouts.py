"""Study of lost references: what each interpolator policy leaves of a plan.

Each run is the shipped experiment `dropouts` in virtual time without a camera, on a bench whose
cable is that of the model, so that swing after the move comes from plan and losses alone.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import msgspec

from rig.analysis.motion import motion_peaks
from rig.analysis.quantities import true_quantities
from rig.analysis.run_log import RunLog
from rig.errors import ConfigError
from rig.run import config
from rig.run.job import plan_move, prepare
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.run.runtime.execute import execute
from rig.run.tasks.controller.interpolator import POLICIES

# move times that the limits of the experiment allow [s]
MOVE_TIMES_S = {"matrix_exponential": 1.5, "zv": 2.0, "mzv": 2.0, "zvd": 3.0, "ei": 3.0}
LOSSES = (0.0, 0.05, 0.1, 0.2, 0.3)
MAX_SEEDS = 1000
BASE = ("camera.rate_hz=0", "experiment.quiet_s=0", "experiment.watch_s=0.8")


class DropoutSpec(msgspec.Struct, frozen=True, kw_only=True):
    """Runs of the study: every planner with every policy, loss and seed."""

    planners: tuple[str, ...] = tuple(MOVE_TIMES_S)
    policies: tuple[str, ...] = tuple(POLICIES)
    losses: tuple[float, ...] = LOSSES
    burst: int = 5  # references lost in a row
    seeds: int = 5

    @property
    def runs(self) -> int:
        """Number of runs."""
        cells = len(self.planners) * len(self.policies) * len(self.losses)
        return cells * self.seeds


class DropoutRow(msgspec.Struct, frozen=True, kw_only=True):
    """Results of one planner, policy and loss over all seeds; None where no run was finished."""

    planner: str
    time_s: float
    policy: str
    loss: float
    finished: int  # runs that were not stopped
    residual_mean_rad: float | None  # true amplitude after the move
    residual_max_rad: float | None
    acceleration_max_m_s2: float  # of the robot, as change of its speed over 30 ms
    outside_max: int  # setpoints outside the envelope in one run


def study(spec: DropoutSpec, progress: Callable[[int], None]) -> list[DropoutRow]:
    """Run every cell; progress is called with the number of runs done. Raises as check() does."""
    check(spec)
    rows = []
    done = 0
    with tempfile.TemporaryDirectory() as scratch:
        for planner, policy, loss in product(spec.planners, spec.policies, spec.losses):
            results = []
            for seed in range(1, spec.seeds + 1):
                results.append(_run(spec, planner, policy, loss, seed, Path(scratch)))
                done += 1
                progress(done)
            rows.append(_row(planner, policy, loss, results))
    return rows


def check(spec: DropoutSpec) -> None:
    """Raise ConfigError for an unknown planner or policy, and for a spec without runs."""
    for kind, names, known in (
        ("planner", spec.planners, MOVE_TIMES_S),
        ("policy", spec.policies, POLICIES),
    ):
        for name in names:
            if name not in known:
                raise ConfigError(f"{kind} {name!r}; must be one of {', '.join(known)}")
    for loss in spec.losses:
        if not 0.0 <= loss < 1.0:
            raise ConfigError(f"loss {loss:g}; must be >= 0 and < 1: a share, 0.1 for 10 %")
    if not 1 <= spec.seeds <= MAX_SEEDS:
        raise ConfigError(f"seeds = {spec.seeds}; must be 1 to {MAX_SEEDS}")
    if not spec.runs:
        raise ConfigError("a list without an entry; must name at least one planner, policy, loss")


class _Result(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one run."""

    residual_rad: float | None  # None: the run was stopped
    acceleration_m_s2: float
    outside: int


def _run(
    spec: DropoutSpec, planner: str, policy: str, loss: float, seed: int, folder: Path
) -> _Result:
    experiment = config.read_experiment("dropouts", _changes(spec, planner, policy, loss, seed))
    job = prepare(experiment, plan_move(experiment), bench.plant(experiment))
    outcome = execute(job, "virtual", folder, _no_progress)
    run = RunLog.open(folder / LOG)
    motion = motion_peaks(run)
    true = true_quantities(run) if outcome.exit_code == 0 else None
    return _Result(
        residual_rad=true.residual_swing_rad if true else None,
        acceleration_m_s2=motion.reached_acceleration_m_s2 or 0.0,
        outside=motion.setpoints_outside or 0,
    )


def _changes(spec: DropoutSpec, planner: str, policy: str, loss: float, seed: int) -> list[str]:
    return [
        *BASE,
        f"experiment.planner={planner}",
        f"experiment.seed={seed}",
        f"move.time_s={MOVE_TIMES_S[planner]}",
        "bench.pendulum.length_m=1.0",
        "bench.pendulum.damping_ratio=0.0",
        f"controller.policy={policy}",
        f"links.reference.loss={loss}",
        f"links.reference.burst={spec.burst}",
    ]


def _no_progress(t_ns: int, operator: Any) -> None:
    """Show nothing: a run takes a fraction of a second."""


def _row(planner: str, policy: str, loss: float, results: Sequence[_Result]) -> DropoutRow:
    residuals = [r.residual_rad for r in results if r.residual_rad is not None]
    return DropoutRow(
        planner=planner,
        time_s=MOVE_TIMES_S[planner],
        policy=policy,
        loss=loss,
        finished=len(residuals),
        residual_mean_rad=statistics.fmean(residuals) if residuals else None,
        residual_max_rad=max(residuals, default=None),
        acceleration_max_m_s2=max(r.acceleration_m_s2 for r in results),
        outside_max=max(r.outside for r in results),
    )
