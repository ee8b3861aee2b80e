"""Runs of every controller on every move and every plant variant of a comparison."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

from planners.errors import unknown_name
from planners.trajectories.trajectory import Trajectory
from rig.analysis.joint_move import MoveMetrics, Recording, move_metrics
from rig.drives.servo.loops import LoopAnalysis
from rig.drives.servo.wiring import position_loop
from rig.errors import ConfigError
from rig.run.joint.controllers import CONTROLLERS, Drive
from rig.studies.servo import bench
from rig.studies.servo.move_on_bench import run_move
from rig.studies.servo.spec import ServoSpec

MAX_SAMPLES = 2_000_000  # of all runs; some minutes of computation
UNPUBLISHED_NOTE = (
    "Source 001 publishes the joint's constants and the moves; its gains are not published and its "
    "traces are lost: the gains",
    "here are ours, so it is the ranking that is comparable. Its PID feeds the speed ahead, as pid "
    "does; lqg feeds the torque",
    "ahead as well. pid_ff does that, too, and shows what of the residual is owed to it.",
)


class ControllerRun(NamedTuple):
    """Run of one controller on one move and one plant variant."""

    plant_variant: str
    move: int  # from 1
    title: str
    controller: str
    delay_s: float  # intended delay of the controller behind the reference
    outcome: MoveMetrics
    recording: Recording


def build_drives(spec: ServoSpec, controllers: Sequence[str]) -> dict[str, Drive]:
    """Build controllers by name.

    Raises PlanError for an unknown name, ServoError for a design that is not possible.
    """
    for name in controllers:
        if name not in CONTROLLERS:
            raise unknown_name("--controllers", name, CONTROLLERS)
    return {name: CONTROLLERS[name](spec) for name in controllers}


def analyse_drives(spec: ServoSpec, drives: Mapping[str, Drive]) -> dict[str, LoopAnalysis]:
    """Analyse the sampled loop of every controller around the modelled joint.

    Opened at the motor torque, closed from the angle of the setpoint to that of the motor.
    """
    return {
        name: position_loop(spec.joint, [drive.loop], spec.drive.period_s).analysis
        for name, drive in drives.items()
    }


def compare(
    spec: ServoSpec, variants: Sequence[str], drives: Mapping[str, Drive]
) -> Iterator[ControllerRun]:
    """Run the controllers one after the other, all of a plant variant and a move together.

    Before the first run it raises ConfigError for a plant variant that is missing in the file or
    not valid, and for too many samples.
    """
    paths = [move.trajectory(spec.model.gear_ratio) for move in spec.move]
    tables = {variant: spec.plant_variant_tables(variant) for variant in variants}
    bench.elastic_joint(spec.bench, spec.seed)
    for variant in variants:
        bench.elastic_joint(tables[variant], spec.seed, f"truth.{variant}")
    durations_s = [run_duration_s(spec, drive.delay_s) for drive in drives.values()]
    check_samples(spec, len(variants) * sum(durations_s))
    order = product(variants, range(len(paths)), drives)
    return (
        _run(spec, variant, tables[variant], move, paths[move], name, drives[name])
        for variant, move, name in order
    )


def _run(
    spec: ServoSpec,
    variant: str,
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
        variant, move + 1, spec.move[move].title, name, drive.delay_s, found, recording
    )


def run_duration_s(spec: ServoSpec, delay_s: float) -> float:
    """Sum the simulated time of one controller over all moves on one plant variant."""
    around_s = spec.rest_s + spec.watch_s + delay_s
    return sum(around_s + move.time_s for move in spec.move)


def check_samples(spec: ServoSpec, seconds: float) -> None:
    """Check the number of samples of a simulated time; raises ConfigError above MAX_SAMPLES."""
    samples, slower_s = seconds / spec.drive.period_s, seconds / MAX_SAMPLES
    if samples > MAX_SAMPLES:
        raise ConfigError(
            f"[drive] period_s = {spec.drive.period_s:g} makes {samples:.3g} samples of "
            f"{seconds:.3g} s on the bench; must be <= {MAX_SAMPLES:.0g}, some minutes of "
            f"computation: sample every {slower_s:.2g} s or slower, or select fewer plant variants "
            "or controllers"
        )
