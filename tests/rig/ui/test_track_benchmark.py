"""`rig track --benchmark`: table, documents, files and exit codes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rig.studies.vision import kit
from rig.ui.cli import track_benchmark
from rig.ui.cli.track_benchmark import COLUMNS

BRIEF = ("track", "--benchmark", "--scenes", "clean,no_cable", "--frames", "6")
CARELESS = """
from vision.protocol import CableAngle

class Careless:
    def __init__(self, width, height):
        pass

    def measure(self, image, pivot_px):
        return CableAngle(0.7)
"""
FIGURES = {
    "bias_rad",
    "std_rad",
    "std_over_bound",
    "worst_rad",
    "refused",
    "refused_share",
    "wrong",
    "wrong_share",
    "error_over_sigma",
    "frames_per_s",
    "frames",
}


@pytest.fixture
def careless(monkeypatch, tmp_path):
    """Module of a tracker in the current folder; the interpreter forgets it afterwards."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "careless_tracker.py").write_text(CARELESS)
    yield "careless_tracker:Careless"
    sys.modules.pop("careless_tracker", None)


def test_the_table_names_scenes_and_trackers_and_fits_eighty_columns(rig, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, said, _ = rig(*BRIEF)
    assert code == 0
    lines = [line.rstrip() for line in said.splitlines()]
    assert max(map(len, lines)) <= 80
    assert "dropped" not in said
    words = [line.split()[0] for line in lines if line]
    start = words.index("clean")
    order = ["clean", "ours", "lsd", "parabola", "no_cable", "ours", "lsd", "parabola"]
    assert words[start : start + 8] == order
    (ours,) = [line.split() for line in lines[: lines.index("no_cable")] if line[:6] == "  ours"]
    assert len(ours) == len(COLUMNS)
    assert ours[5:7] == ["0.0", "0.0"]
    assert "one frame in 10" in " ".join(said.split())
    assert "ours: 2 of 2 scenes passed" in said


def test_a_scene_name_of_20_letters_leaves_every_column_on_eighty(rig, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    (result,) = kit.run(["clean"], kit.OURS, frames=2)
    long = "a" * 20
    monkeypatch.setattr(track_benchmark.kit, "run", lambda *_: [_renamed(result, long)])
    _, said, _ = rig(*BRIEF)
    assert long in said
    assert "dropped" not in said
    assert max(map(len, said.splitlines())) <= 80


def _renamed(result, scene):
    fields = {name: getattr(result, name) for name in result.__struct_fields__}
    return type(result)(**{**fields, "scene": scene})


def test_the_document_has_every_figure_of_every_tracker(rig) -> None:
    code, said, told = rig(*BRIEF, "--json")
    document = json.loads(said)
    assert (code, told.strip(), document["exit_status"]) == (0, "", "ok")
    assert (document["tracker"], document["frames"], document["peer_step"]) == ("ours", 6, 10)
    results = document["results"]
    assert [one["tracker"] for one in results] == ["ours", "lsd", "parabola"] * 2
    assert {frozenset(one["score"]) for one in results} == {frozenset(FIGURES)}
    hidden = results[3]
    assert (hidden["expect"], hidden["score"]["refused"]) == ("refuse", 6)
    assert hidden["score"]["bias_rad"] is None


def test_a_tracker_below_a_bar_ends_with_six_and_is_named_in_table_and_file(rig, careless) -> None:
    code, said, _ = rig(*BRIEF, "--tracker", careless, "--junit", "out.xml")
    assert code == 6
    assert f"{careless}: 0 of 2 scenes passed" in said
    assert "no_cable: silently wrong pictures 6; must be <= 0" in said
    assert "written: out.xml" in said
    rows = [line.split()[0] for line in said.splitlines() if line.startswith("  ")]
    assert rows.count("Careless") == rows.count("ours") == rows.count("lsd") == 2
    (suite,) = ElementTree.parse(Path("out.xml")).getroot()
    assert {case.get("classname") for case in suite} == {careless}
    assert (suite.get("tests"), suite.get("failures")) == ("2", "2")


def test_the_document_of_a_tracker_below_a_bar_has_the_reasons(rig, careless) -> None:
    code, said, _ = rig(*BRIEF, "--tracker", careless, "--json")
    document = json.loads(said)
    assert (code, document["exit_status"], document["tracker"]) == (6, "bad_data", careless)
    assert "no_cable: silently wrong pictures 6; must be <= 0" in document["reasons"]


def test_the_file_for_a_ci_has_the_tested_tracker_only(rig) -> None:
    code, said, _ = rig(*BRIEF, "--junit", "ours.xml", "--json")
    assert code == 0
    json.loads(said)
    (suite,) = ElementTree.parse(Path("ours.xml")).getroot()
    cases = [(case.get("classname"), case.get("name")) for case in suite]
    assert cases == [("ours", "clean"), ("ours", "no_cable")]


def test_without_a_choice_all_scenes_are_measured(rig, monkeypatch) -> None:
    asked = []

    def run(scenes, trackers, frames, progress):
        asked.append((scenes, list(trackers), frames))
        return results

    results = kit.run(["clean"], kit.OURS, frames=1)
    monkeypatch.setattr(track_benchmark.kit, "run", run)
    assert rig("track", "--benchmark")[0] == 0
    assert asked == [(kit.shipped_scenes(), ["ours", "lsd", "parabola"], None)]


MISTAKES = {
    "neither video nor benchmark": (["track"], "VIDEO: missing; must be a video file"),
    "a video too": ([*BRIEF, "v.avi"], "VIDEO v.avi with --benchmark"),
    "a pivot too": ([*BRIEF, "--pivot", "1,2"], "--pivot 1,2 with --benchmark"),
    "scenes without benchmark": (
        ["track", "v.avi", "--pivot", "1,2", "--scenes", "clean"],
        "--scenes clean without --benchmark",
    ),
    "an unknown scene": (["track", "--benchmark", "--scenes", "clene"], "clene"),
    "no scene": (["track", "--benchmark", "--scenes", ","], "--scenes ','; must be names"),
    "no such module": ([*BRIEF, "--tracker", "nowhere:X"], "module nowhere cannot be imported"),
    "a tracker that is none": ([*BRIEF, "--tracker", "nowhere"], "must be package.module:Class"),
    "no such folder": ([*BRIEF, "--junit", "no/out.xml"], "--junit 'no/out.xml': no folder 'no'"),
    "no frames": (["track", "--benchmark", "--frames", "0"], "--frames"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_ends_with_two_and_a_message(rig, monkeypatch, name) -> None:
    monkeypatch.setattr(sys, "path", list(sys.path))
    words, text = MISTAKES[name]
    code, said, told = rig(*words)
    assert (code, said) == (2, "")
    assert text in " ".join(told.split())
