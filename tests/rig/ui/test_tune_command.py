"""`rig tune`: a load that the experiment file does not know, found and planned for."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

from rig.run import config
from rig.ui.cli.tuned_file import tuned_text


def test_a_wrong_length_is_found_and_the_swing_is_gone(rig) -> None:
    code, said, _ = rig(
        "tune", "--virtual", "--json", "--set", "bench.pendulum.length_m=0.9", "--out", "mine.toml"
    )
    document = json.loads(said)
    assert (code, document["verdict"]) == (0, "good"), document["reasons"]
    found = document["identification"]
    assert abs(found["cable_length_m"] - 0.9) < 3.0 * found["sigma_cable_length_m"]
    before = document["before"]["measured"]["residual_swing_rad"]
    after = document["after"]["measured"]["residual_swing_rad"]
    assert before > 15e-3
    assert after < 0.5e-3
    assert document["excited"] is None
    tuned = tomllib.loads(Path("mine.toml").read_text())
    assert tuned["model"]["length_m"] == pytest.approx(found["cable_length_m"], rel=1e-5)
    assert config.read_experiment("mine.toml", []).experiment.name == "move"


def test_a_load_that_hardly_swings_is_excited_first(rig) -> None:
    brief = ("--set", "experiment.quiet_s=0.6", "--set", "experiment.watch_s=5")
    code, said, _ = rig("tune", "--virtual", "--set", "bench.pendulum.length_m=1.0", *brief)
    assert code == 0
    assert "found: cable of 1.00" in said
    assert "rig run tuned.toml" in said
    assert len(list(Path("runs").iterdir())) == 3  # before, excited, after


def test_an_experiment_without_a_cable_to_move_is_refused(rig) -> None:
    for words, hint in (
        (["free_decay"], "has no move from rest to rest"),
        (["move", "--set", "camera.rate_hz=0"], "has no camera"),
        (["move", "--out", "x.txt"], "must be a .toml file"),
    ):
        code, _, said = rig("tune", "--virtual", *words)
        assert code == 2
        assert hint in " ".join(said.split())


@pytest.mark.parametrize("name", config.shipped())
def test_the_written_file_says_what_the_experiment_says(name: str, tmp_path: Path) -> None:
    path = tmp_path / "copy.toml"
    path.write_text(tuned_text(name, []))
    assert config.read_experiment(str(path), []) == config.read_experiment(name, [])


def test_the_experiment_that_is_read_is_never_written(rig, tmp_path) -> None:
    (tmp_path / "mine.toml").write_text(tuned_text("move", []))
    code, _, said = rig("tune", "mine.toml", "--virtual", "--out", "mine.toml")
    assert code == 2
    assert "is the experiment that is read" in " ".join(said.split())
