"""Every controller on every move and every truth of a comparison."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from planners.errors import unknown_name
from rig.runtime import bench
from rig.servo_studies.bench_run import Outcome, Recording, outcome, run
from rig.servo_studies.controllers import CONTROLLERS
from rig.servo_studies.spec import ServoSpec


class Row(NamedTuple):
    """One run."""

    truth: str
    move: int  # from 1
    title: str
    controller: str
    late_s: float  # by which the controller is meant to be later
    outcome: Outcome
    recording: Recording


def compare(spec: ServoSpec, truths: Sequence[str], controllers: Sequence[str]) -> Iterator[Row]:
    """Runs one after the other, all of a truth and a move together.

    Raises ConfigError or PlanError for a truth or controller nobody knows, ServoError for gains that cannot be had; all of them
    before the first run.
    """
    for name in controllers:
        if name not in CONTROLLERS:
            raise unknown_name("--controllers", name, CONTROLLERS)
    tables = {truth: spec.truth_tables(truth) for truth in truths}
    paths = [move.trajectory(spec.model.gear_ratio) for move in spec.move]
    built = {name: CONTROLLERS[name](spec) for name in controllers}
    for truth in truths:
        bench.elastic_joint(tables[truth], spec.seed)
    for truth, move, name in product(truths, range(len(spec.move)), controllers):
        joint, drive = bench.elastic_joint(tables[truth], spec.seed), built[name]
        drive.controller.reset()
        recording = run(joint, drive.controller, paths[move], spec.model.gear_ratio, spec.drive.period_s, spec.watch_s)
        yield Row(truth, move + 1, spec.move[move].title, name, drive.late_s, outcome(recording, drive.late_s), recording)
