"""Completion in the shell: planners, laws, experiments and runs, from what there is."""

import subprocess
import sys

import pytest

from rig.ui.cli import completion

PROGRAM = """
import sys
sys.argv = ["rig"]
from rig.ui.cli.entry import main
main()
"""


def completed(words, folder):
    """What a shell offers for the last word of `rig words`."""
    ended = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM],
        env={
            **environment(),
            "_RIG_COMPLETE": "complete_bash",
            "COMP_WORDS": f"rig {words}",
            "COMP_CWORD": str(len(words.split(" "))),
        },
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    return ended.stdout.split()


def environment():
    import os

    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


@pytest.fixture
def folder(tmp_path):
    """Folder with two recorded runs and an experiment."""
    for name in ("20260101T000000Z_move_wall_aaaa", "20260102T000000Z_move_wall_bbbb"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "run.mcap").touch()
    (tmp_path / "mine.toml").touch()
    return tmp_path


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("run --planner matrix", ["matrix_exponential"]),
        ("run --planner zv,coll", ["zv,collocation"]),
        ("plan --planner shoo", ["shooting"]),
        ("plan --law cub", ["cubic"]),
        ("laws plot gut", ["gutman_1_3"]),
        ("run m", ["move", "mine.toml"]),
        ("sim free", ["free_decay"]),
        ("calibrate offsets --experiment drop", ["dropouts"]),
        ("analyze l", ["last"]),
        (
            "analyze 2026",
            ["20260102T000000Z_move_wall_bbbb", "20260101T000000Z_move_wall_aaaa"],
        ),
        ("export 20260101", ["20260101T000000Z_move_wall_aaaa"]),
        ("plan --length 98cm --planner zvdd", ["zvdd", "zvddd"]),
    ],
)
def test_a_shell_is_offered_what_fits(folder, words, offered):
    assert completed(words, folder) == offered


def test_the_values_are_imported_when_they_are_asked_for():
    code = (
        "import sys, rig.ui.cli.completion; "
        "print(*(name for name in sys.modules if name.split('.')[0] in ('planners', 'numpy')))"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=environment(), capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert ended.stdout.split() == []


def test_nothing_is_offered_where_nothing_fits(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert completion.planners("xyz") == []
    assert completion.laws("xyz") == []
    assert completion.experiments("xyz") == []
