"""The job of a run: what is refused before anything starts."""

from __future__ import annotations

import pytest

from rig.errors import Refused
from rig.run.config import read_experiment
from rig.run.job import Plant, plan_move, prepare
from rig.run.runtime import bench


def test_the_policy_source_is_refused_where_the_bench_is_not_simulated() -> None:
    chosen = read_experiment("free_decay", ["controller.policy=source", "bench.kind=external"])
    with pytest.raises(Refused, match=r"must be 'bounded' with \[bench\] kind = 'external'"):
        prepare(chosen, None, Plant(settings=None, links=1))


def test_the_plant_is_given_the_envelope_of_the_experiment() -> None:
    changes = ["safety.depth_m=0.1", "safety.speed_m_s=0.9", "limits.acceleration_m_s2=4"]
    bounds = bench.plant(read_experiment("move", changes)).settings.input
    assert bounds.lower_m == (-0.25, -0.1, -0.1)
    assert bounds.upper_m == (0.25, 0.1, 0.1)
    assert (bounds.speed_m_s, bounds.acceleration_m_s2) == (0.9, pytest.approx(4.4))
    assert bounds.stops


def test_with_the_policy_source_the_plant_counts_and_does_not_stop() -> None:
    chosen = read_experiment("move", ["controller.policy=source"])
    assert not bench.plant(chosen).settings.input.stops


def test_the_controller_is_given_policy_and_following_error_of_the_experiment() -> None:
    changes = [
        "controller.policy=source",
        "safety.servo_lag_ms=12",
        "safety.following_error_mm=7",
        "safety.following_error_ms=90",
    ]
    chosen = read_experiment("move", changes)
    settings = prepare(chosen, plan_move(chosen), bench.plant(chosen)).settings["controller"]
    assert settings.policy == "source"
    assert settings.servo_lag_ns == 12_000_000
    assert settings.following_error_m == pytest.approx(0.007)
    assert settings.following_error_ns == 90_000_000
