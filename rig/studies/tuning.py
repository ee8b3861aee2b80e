"""Tuning of a move to a load that its experiment file does not know: excite, identify, plan, run.

The load is identified from the log alone. The truth of a simulated bench is never read here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from planners.problem import Limits
from rig.analysis.analyze import RunAnalysis
from rig.analysis.identified_swing import identify_swing
from rig.analysis.identify.identification import Identification
from rig.errors import BAD_DATA, OK, ConfigError
from rig.run import config
from rig.run.config import Experiment
from rig.studies.robust_choice import RobustChoice, choose_planner

EXCITING_PLANNER = "law"  # a motion law without a model of the load: it swings
MIN_SWING_RAD = 2e-3  # of a swing from which a length follows
MAX_LENGTH_SIGMA_REL = 0.02
MIN_WATCHED_PERIODS = 5.0
GOOD_FACTOR = 2.0  # residual swing after tuning over the largest one predicted
FLOOR_RAD = 0.3e-3  # residual swing of a good plan
Run = Callable[[str, Experiment], RunAnalysis]


class Tuning(NamedTuple):
    """Runs before and after, what was identified, and the changes of the experiment file."""

    before: RunAnalysis
    excited: RunAnalysis | None  # a run of its own, where the first one swings too little
    found: Identification
    choice: RobustChoice | None
    after: RunAnalysis | None
    changes: tuple[str, ...]  # "section.key=value", as for --set
    verdict: str  # good, doubtful or refused
    reasons: tuple[str, ...]

    @property
    def exit_code(self) -> int:
        """Exit code of the command."""
        return OK if self.verdict == "good" else BAD_DATA


def tune(name: str, changes: list[str], run: Run) -> Tuning:
    """Tune the experiment of a name or file.

    run: executes an experiment under a title and analyses its log. Raises ConfigError for an
    experiment that moves no cable with a camera.
    """
    first = config.read_experiment(name, changes)
    _check(first)
    before = run("before", first)
    source, excited = before, None
    found = identify_swing(before.run)
    if not _is_enough(found):
        exciting = [*changes, f"experiment.planner={EXCITING_PLANNER}", "plan.robust=[]"]
        source = excited = run("excite", config.read_experiment(name, exciting))
        found = identify_swing(source.run)
    length_m, sigma_m = found.cable_length_m, found.sigma_cable_length_m
    if length_m is None or sigma_m is None or not found.modes:
        texts = tuple(reason.text for reason in found.reasons)
        return Tuning(before, excited, found, None, None, (), "refused", texts)
    damping_ratio = min(max(found.modes[0].damping_ratio, 0.0), 0.9)
    move = first.move
    bounds = first.limits
    choice = choose_planner(
        length_m,
        sigma_m,
        damping_ratio,
        distance_m=move.distance_m,
        time_s=move.time_s,
        limits=Limits(speed_m_s=bounds.speed_m_s, acceleration_m_s2=bounds.acceleration_m_s2),
    )
    candidate = choice.chosen.candidate
    robust = ", ".join(f'"{one}"' for one in candidate.robust)
    tuned = (
        f"model.length_m={length_m:.6g}",
        f"model.damping_ratio={damping_ratio:.4g}",
        f"experiment.planner={candidate.planner}",
        f"plan.robust=[{robust}]",
    )
    after = run("after", config.read_experiment(name, [*changes, *tuned]))
    reasons = tuple(_doubts(found, choice, after))
    verdict = "doubtful" if reasons else "good"
    return Tuning(before, excited, found, choice, after, tuned, verdict, reasons)


def _check(experiment: Experiment) -> None:
    name = experiment.experiment.name
    if not experiment.has_move or experiment.joint is not None or experiment.move.waypoints:
        raise ConfigError(
            f"experiment '{name}' has no move from rest to rest of a cable; must have one: take "
            "`rig tune move`, or a file like it"
        )
    if experiment.camera.rate_hz == 0:
        raise ConfigError(
            f"experiment '{name}' has no camera; must have one to see the load: set camera.rate_hz"
        )
    if experiment.move.axis == "z" or experiment.model.links:
        raise ConfigError(
            f"experiment '{name}' moves along z or has a chain; must move one cable along x or y: "
            "change [move] axis, or remove [model] links"
        )


def _is_enough(found: Identification) -> bool:
    """Tell if a length follows from a swing."""
    if found.cable_length_m is None or found.sigma_cable_length_m is None or not found.modes:
        return False
    is_sharp = found.sigma_cable_length_m <= MAX_LENGTH_SIGMA_REL * found.cable_length_m
    return is_sharp and found.modes[0].amplitude >= MIN_SWING_RAD


def _doubts(found: Identification, choice: RobustChoice, after: RunAnalysis) -> list[str]:
    """List why the tuned move is not as it should be."""
    doubts = []
    if found.verdict != "good":
        doubts += [f"identification: {reason.text}" for reason in found.reasons]
    summary = after.summary
    if summary.verdict != "good":
        doubts += summary.reasons
    residual_rad = summary.measured.residual_swing_rad
    bound_rad = max(GOOD_FACTOR * choice.chosen.worst_rad, FLOOR_RAD)
    if residual_rad is not None and residual_rad > bound_rad:
        doubts.append(
            f"the tuned move leaves {1e3 * residual_rad:.2f} mrad; must be <= "
            f"{1e3 * bound_rad:.2f} mrad: the load is not one cable, or robot and plan differ"
        )
    return doubts
