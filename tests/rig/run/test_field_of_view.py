"""Field of view before a run: what leaves the picture or the calibrated range is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.errors import Refused
from rig.run import config, experiment
from rig.run.field_of_view import cable_view
from rig.run.job import plan_move, prepare
from rig.run.runtime import bench

FAR = ["safety.position_max_m=1.5", "safety.position_min_m=-1.5", "vision.calibration=none"]
FAST = ["limits.speed_m_s=19", "limits.acceleration_m_s2=390"]


def prepared(*changes: str) -> object:
    chosen = config.read_experiment("move", list(changes))
    return prepare(chosen, plan_move(chosen), bench.plant(chosen))


def test_the_shipped_experiments_stay_in_the_picture() -> None:
    for name in config.shipped():
        chosen = config.read_experiment(name, [])
        if chosen.experiment.kind == "move":
            prepare(chosen, plan_move(chosen), bench.plant(chosen))


def test_a_move_out_of_the_calibrated_range_names_the_range() -> None:
    with pytest.raises(Refused, match=r"0\.000 to 0\.240 m; the calibration .* -0\.200 to 0\.200"):
        prepared("move.distance_m=0.24")
    prepared("move.distance_m=0.204")


def test_a_move_out_of_the_picture_names_instant_columns_and_what_to_change() -> None:
    with pytest.raises(Refused, match=r"out of the picture 1\.\d+ s into the move.*columns 6\d\d"):
        prepared("move.distance_m=0.33", *FAR)
    prepared("move.distance_m=0.29", *FAR)
    prepared("move.distance_m=0.33", "camera.rate_hz=0", *FAR)


def test_a_fast_move_leaves_the_picture_on_its_way() -> None:
    prepared("move.distance_m=0.2", "move.time_s=1.0", *FAR, *FAST)
    with pytest.raises(Refused, match=r"out of the picture"):
        prepared("move.distance_m=0.2", "move.time_s=0.55", *FAR, *FAST)


def test_the_view_is_that_of_a_pinhole_before_the_plane(tmp_path: Path) -> None:
    """At the end of a move without swing the cable hangs at pivot + scale x."""
    chosen = config.read_experiment("move", ["experiment.planner=law", "move.time_s=8"])
    plan = plan_move(chosen)
    assert plan is not None
    job = prepare(chosen, plan, bench.plant(chosen))
    vision = job.settings["vision"]
    view = cable_view(plan, vision)
    expected = vision.pivot_home_px[0] + 0.2 * vision.pixels_per_m
    np.testing.assert_allclose(view.columns_px[-1], expected, atol=6.0)


def test_nothing_is_left_behind_by_a_refusal(tmp_path: Path) -> None:
    chosen = config.read_experiment("move", ["move.distance_m=0.24"])
    with pytest.raises(Refused):
        experiment.run(chosen, "virtual", tmp_path, lambda *_: None, lambda *_: None)
    assert not list(tmp_path.iterdir())
