"""Catalogue of the shipped experiments: one row each, read from their files."""

from __future__ import annotations

import msgspec

from rig.run import config
from rig.run.config import Experiment


class ShippedExperiment(msgspec.Struct, frozen=True, kw_only=True):
    """Row of the catalogue; None where an experiment has no such value."""

    name: str
    kind: str
    distance_m: float | None = None  # of the platform
    load_angle_deg: float | None = None  # of an elastic joint
    time_s: float | None = None  # of the move
    planner: str | None = None
    purpose: str = ""


def shipped_experiments() -> list[ShippedExperiment]:
    """Read the catalogue, in the order of the names."""
    return [_row(config.read_experiment(name, [])) for name in config.shipped()]


def _row(e: Experiment) -> ShippedExperiment:
    head = e.experiment
    row = ShippedExperiment(name=head.name, kind=head.kind, purpose=head.purpose)
    replace = msgspec.structs.replace
    if e.joint is not None:
        move = e.joint.move
        return replace(row, load_angle_deg=move.load_angle_deg, time_s=move.time_s)
    if not e.has_move:
        return row
    return replace(row, distance_m=e.move.distance_m, time_s=e.move.time_s, planner=head.planner)
