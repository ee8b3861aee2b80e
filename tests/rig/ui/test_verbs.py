"""A verb's module is imported when the verb is called, and not before."""

import subprocess
import sys
from importlib import import_module

import pytest

from rig.ui.cli.verbs import CAN_VERBS, SERVO_VERBS, STUDY_VERBS, VERBS

ROWS = [row for table in (VERBS, SERVO_VERBS, STUDY_VERBS, CAN_VERBS) for row in table.values()]

HEAVY = (
    "numpy",
    "scipy",
    "cv2",
    "matplotlib",
    "control",
    "mcap",
    "can",
    "canopen",
    "cantools",
    "planners.problem",
    "vision.tracker",
)


def modules_after(*words):
    """Names of the modules that are loaded when `rig words` ends."""
    code = f"""
import atexit, sys
atexit.register(lambda: print("MODULES", *sys.modules, file=sys.stderr))
sys.argv = ["rig", *{list(words)!r}]
from rig.ui.cli.entry import main
main()
"""
    ended = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    (line,) = [line for line in ended.stderr.splitlines() if line.startswith("MODULES")]
    return set(line.split()[1:])


@pytest.mark.parametrize(
    "words",
    [("--help",), ("--version",), ("servo", "--help"), ("study", "--help"), ("can", "--help")],
)
def test_help_loads_no_numerical_library(words):
    assert modules_after(*words).isdisjoint(HEAVY)


def test_a_stop_loads_no_socket_and_no_table_library_where_nothing_runs(tmp_path):
    loaded = modules_after("stop", "--runs", str(tmp_path))
    assert loaded.isdisjoint({*HEAVY, "zmq", "rich.table", "msgspec"})


def test_no_verb_loads_another_verb():
    loaded = modules_after("servo", "notch", "--help")
    assert "rig.ui.cli.servo_notch" in loaded
    assert loaded.isdisjoint({"rig.ui.cli.servo_compare", "rig.ui.cli.run", "scipy.optimize"})
    loaded = modules_after("study", "dropouts", "--help")
    assert "rig.ui.cli.study_dropouts" in loaded
    assert loaded.isdisjoint({"rig.studies.dropouts", "rig.ui.cli.run", "matplotlib", "scipy"})


@pytest.mark.parametrize("verb", ROWS, ids=lambda v: v.target)
def test_every_row_of_the_tables_leads_to_a_verb_with_an_imperative_help(verb):
    module, _, attribute = verb.target.partition(":")
    assert getattr(import_module(module), attribute) is not None
    assert verb.help[0].isupper()
    assert verb.help.endswith(".")
    assert len(verb.help) <= 64
