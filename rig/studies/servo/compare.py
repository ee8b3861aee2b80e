"""Every controller on every move and every truth of a comparison."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from planners.errors import unknown_name
from planners.trajectories.trajectory import Trajectory
from rig.drives.servo.loops import LoopAnalysis
from rig.drives.servo.wiring import position_loop
from rig.errors import ConfigError
from rig.studies.servo import bench
from rig.studies.servo.controllers import CONTROLLERS, Drive
from rig.studies.servo.move_on_bench import MoveMetrics, Recording, move_metrics, run_move
from rig.studies.servo.spec import ServoSpec

MAX_SAMPLES = 2_000_000  # some minutes
UNPUBLISHED_NOTE = (
    "Source 001 publishes the joint's constants and the moves; its gains are not published and its traces are lost: the gains",
    "here are ours, so it is the ranking that is comparable. Its PID feeds the speed ahead, as pid does; lqg feeds the torque",
    "ahead as well. pid_ff does that, too, and shows what of the residual is owed to it.",
)


class ControllerRun(NamedTuple):
    """One run."""

    plant_variant: str
    move: int  # from 1
    title: str
    controller: str
    delay_s: float  # by which the controller is meant to be later
    outcome: MoveMetrics
    recording: Recording


def build_drives(spec: ServoSpec, controllers: Sequence[str]) -> dict[str, Drive]:
    """By name. Raises PlanError for a controller nobody knows, ServoError for gains that cannot be had."""
    for name in controllers:
        if name not in CONTROLLERS:
            raise unknown_name("--controllers", name, CONTROLLERS)
    return {name: CONTROLLERS[name](spec) for name in controllers}


def analyse_drives(spec: ServoSpec, drives: Mapping[str, Drive]) -> dict[str, LoopAnalysis]:
    """Every controller's sampled loop around the joint that is believed in: opened at the motor's torque, closed from the
    setpoint's angle to the motor's.
    """
    return {
        name: position_loop(spec.joint, [drive.loop], spec.drive.period_s).analysis
        for name, drive in drives.items()
    }


def compare(
    spec: ServoSpec, truths: Sequence[str], drives: Mapping[str, Drive]
) -> Iterator[ControllerRun]:
    """Runs one after the other, all of a truth and a move together.

    Raises ConfigError, before the first run, for a truth that the file has not or that is none, and for too much work.
    """
    paths = [move.trajectory(spec.model.gear_ratio) for move in spec.move]
    tables = {truth: spec.plant_variant_tables(truth) for truth in truths}
    bench.elastic_joint(spec.bench, spec.seed)
    for truth in truths:
        bench.elastic_joint(tables[truth], spec.seed, f"truth.{truth}")
    _check_work(spec, truths, drives)
    order = product(truths, range(len(paths)), drives)
    return (
        _run(spec, truth, tables[truth], move, paths[move], name, drives[name])
        for truth, move, name in order
    )


def _run(
    spec: ServoSpec,
    truth: str,
    table: dict[str, Any],
    move: int,
    path: Trajectory,
    name: str,
    drive: Drive,
) -> ControllerRun:
    drive.controller.reset()
    recording = run_move(
        bench.elastic_joint(table, spec.seed),
        drive.controller,
        path,
        spec.model.gear_ratio,
        spec.drive.period_s,
        rest_s=spec.rest_s,
        watch_s=drive.delay_s + spec.watch_s,
    )
    limit = min(spec.drive.torque_limit_n_m, table.get("torque_limit_n_m", math.inf))
    found = move_metrics(recording, drive.delay_s, limit)
    return ControllerRun(
        truth, move + 1, spec.move[move].title, name, drive.delay_s, found, recording
    )


def _check_work(spec: ServoSpec, truths: Sequence[str], drives: Mapping[str, Drive]) -> None:
    """Raises ConfigError for more samples than anybody waits for."""
    around = spec.rest_s + spec.watch_s
    seconds = len(truths) * sum(
        around + move.time_s + drive.delay_s for move in spec.move for drive in drives.values()
    )
    samples, slower_s = seconds / spec.drive.period_s, seconds / MAX_SAMPLES
    if samples > MAX_SAMPLES:
        raise ConfigError(
            f"[drive] period_s = {spec.drive.period_s:g} makes {samples:.3g} samples of {seconds:.3g} s on the bench; must be "
            f"<= {MAX_SAMPLES:.0g}, some minutes: sample every {slower_s:.2g} s or slower, or name fewer truths or controllers"
        )
