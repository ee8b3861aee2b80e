"""Every controller on every move and every truth of a comparison."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

from planners.errors import unknown_name
from rig.runtime import bench
from rig.servo.loops import Facts
from rig.servo.wiring import position_loop
from rig.servo_studies.bench_run import Outcome, Recording, outcome, run
from rig.servo_studies.controllers import CONTROLLERS, Drive
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


def designs(spec: ServoSpec, controllers: Sequence[str]) -> dict[str, Facts]:
    """Every controller's sampled loop around the joint that is believed in: opened at the motor's torque, closed from the
    setpoint's angle to the motor's. Raises what compare() does.
    """
    drives = built(spec, controllers)
    return {name: position_loop(spec.joint, [drive.loop], spec.drive.period_s).facts for name, drive in drives.items()}


def built(spec: ServoSpec, controllers: Sequence[str]) -> dict[str, Drive]:
    """By name. Raises PlanError for a controller nobody knows, ServoError for gains that cannot be had."""
    for name in controllers:
        if name not in CONTROLLERS:
            raise unknown_name("--controllers", name, CONTROLLERS)
    return {name: CONTROLLERS[name](spec) for name in controllers}


def compare(spec: ServoSpec, truths: Sequence[str], controllers: Sequence[str]) -> Iterator[Row]:
    """Runs one after the other, all of a truth and a move together.

    Raises ConfigError or PlanError for a truth or controller nobody knows, ServoError for gains that cannot be had; all of them
    before the first run.
    """
    drives = built(spec, controllers)
    tables = {truth: spec.truth_tables(truth) for truth in truths}
    paths = [move.trajectory(spec.model.gear_ratio) for move in spec.move]
    for truth in truths:
        bench.elastic_joint(tables[truth], spec.seed)
    for truth, move, name in product(truths, range(len(spec.move)), controllers):
        joint, drive = bench.elastic_joint(tables[truth], spec.seed), drives[name]
        drive.controller.reset()
        recording = run(joint, drive.controller, paths[move], spec.model.gear_ratio, spec.drive.period_s, spec.watch_s)
        yield Row(truth, move + 1, spec.move[move].title, name, drive.late_s, outcome(recording, drive.late_s), recording)
