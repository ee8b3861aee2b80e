"""`rig calibrate offsets` in several lights."""

from __future__ import annotations

import json

import pytest

KEYS = (
    *("bench.camera.light.flank=60", "bench.camera.pitch_deg=0"),
    *("camera.width=320", "camera.height=240", "bench.camera.pixels_per_m=500"),
    *("camera.rate_hz=25", "bench.robot.kind=cartesian"),
    *("vision.rough_pivot_px=[160,-20]", "vision.rough_pixels_per_m=500"),
)
FLANK = [word for key in KEYS for word in ("--set", key)]


def level(value: float) -> tuple[str, str]:
    """Options for a level of the light on the screen."""
    return "--set", f"bench.camera.light.level={value}"


def offset_error_rad(rig, calibration: str) -> float:
    """Measure how far off a swing is in a light between those of the calibration."""
    code, said, _ = rig(
        *("run", "free_decay", "--virtual", "--no-report", "--json", *FLANK, *level(0.55)),
        *("--set", "experiment.watch_s=4", "--set", f"vision.calibration={calibration}"),
        *("--set", "bench.pendulum.initial_swing_rad=0.005"),
    )
    assert code == 0
    return float(json.loads(said)["swing_error"]["outside_move_rad"])


def test_the_offset_follows_the_light_where_it_was_calibrated_in_several(rig) -> None:
    tour = ("calibrate", "offsets", "--virtual", "--json", *FLANK)
    assert rig(*tour, "--out", "one.toml")[0] == 0
    assert rig(*tour, "--out", "both.toml")[0] == 0
    code, said, _ = rig(*tour, *level(0.5), "--add", "both.toml")
    assert code == 0
    made = json.loads(said)["calibration"]
    (darker,) = made["lights"]
    # the light on the flank counts twice before a screen of half the level
    assert darker["background"] == pytest.approx(100.0, abs=1.0)
    assert darker["offset_rad"] == pytest.approx([2.1 * x for x in made["offset_rad"]], rel=0.1)
    fixed, followed = (offset_error_rad(rig, name) for name in ("one.toml", "both.toml"))
    assert followed < 0.4 * fixed


def test_a_light_is_not_added_to_a_file_that_is_not_there(rig) -> None:
    code, _, said = rig("calibrate", "offsets", "--virtual", "--add", "no.toml")
    assert code == 2
    assert "'no.toml': no such file" in said
    code, _, said = rig("calibrate", "offsets", "--add", "no.toml", "--out", "b.toml")
    assert (code, "--add with --out" in said) == (2, True)
