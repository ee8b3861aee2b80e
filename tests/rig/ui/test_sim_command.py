"""`rig sim`: scenes and experiments as videos with their truth."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from rig.studies.vision.scene import shipped_scenes

FILES = ("--video", "v.mkv", "--truth", "t.csv")


def test_the_list_of_the_scenes_has_every_shipped_one(rig) -> None:
    code, said, _ = rig("sim", "--list-scenes")
    assert code == 0
    assert all(name in said for name in shipped_scenes())
    code, said, _ = rig("sim", "--list-scenes", "--json")
    scenes = json.loads(said)["scenes"]
    assert [scene["name"] for scene in scenes] == shipped_scenes()
    assert {scene["expect"] for scene in scenes} == {"angle", "refuse"}


def test_a_scene_is_rendered_with_its_stamps_and_the_next_command_is_told(rig) -> None:
    code, said, _ = rig("sim", "--scene", "variable_rate", *FILES, "--frames", "9")
    assert code == 0
    assert "6 frames in v.mkv" in said
    assert "next: rig track v.mkv" in said
    with Path("t.csv").open() as file:
        stamps = [float(row["t_s"]) for row in csv.DictReader(file)]
    assert stamps == pytest.approx([0.0, 0.02, 0.06, 0.08, 0.12, 0.14])


def test_a_scene_file_beside_the_user_is_rendered(rig) -> None:
    Path("mine.toml").write_text("[scene]\nabout = 'a dim screen'\n[bench.camera]\nnoise = 1\n")
    code, said, _ = rig("sim", "--scene", "mine.toml", *FILES, "--frames", "3", "--json")
    assert code == 0
    assert json.loads(said)["frames"] == 3


def test_an_experiment_is_rendered_as_before(rig) -> None:
    code, said, _ = rig("sim", "free_decay", *FILES, "--seconds", "0.1", "--json")
    assert code == 0
    assert json.loads(said)["frames"] == 5


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--video", "v.avi"), "rig sim without --truth; must have both"),
        ((), "rig sim without --video and --truth"),
        (("--scene", "claen", *FILES), "did you mean 'clean'"),
        (("--scene", "clean", *FILES, "--set", "scene.expct=1"), "did you mean 'expect'"),
        (
            ("--scene", "clean", "--video", "v.avi", "--truth", "t.csv", "--stamps", "holes"),
            "ending '.avi' with stamps 'holes'; must be one of .mkv",
        ),
    ],
)
def test_a_wrong_call_is_told_with_the_next_step(rig, arguments, told) -> None:
    code, _, said = rig("sim", *arguments)
    assert code == 2
    assert told in " ".join(said.split())
