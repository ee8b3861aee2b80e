"""`--help`: each verb ends with two examples that can be run; numbers are short."""

import re
import shlex

import pytest

from rig.ui.cli.examples import EXAMPLES
from rig.ui.cli.verbs import CAN_VERBS, SERVO_VERBS, STUDY_VERBS, VERBS, load

QUICK = (  # verbs whose examples need neither an earlier run nor more than a second or two
    "plan",
    "laws",
    "laws compare",
    "laws plot",
    "spline",
    "motor-check",
    "size",
    "servo notch",
    "servo observer",
    "servo shaping",
)
GROUPS = {"servo": SERVO_VERBS, "study": STUDY_VERBS, "can": CAN_VERBS}
BRIEF = "--no-report --set experiment.quiet_s=0.6 --set experiment.watch_s=2.5"


def commands():
    """Every command by its words below `rig`."""
    found = {}
    pending = [(name, load(name, verb)) for name, verb in VERBS.items()]
    for group, verbs in GROUPS.items():
        pending += [(f"{group} {name}", load(name, row, group)) for name, row in verbs.items()]
    while pending:
        words, command = pending.pop()
        found[words] = command
        for name, inner in getattr(command, "commands", {}).items():
            pending.append((f"{words} {name}", inner))
    return found


COMMANDS = commands()


def parse(example):
    """Parse an example down to its command, without running it."""
    words = shlex.split(example)
    name = next(" ".join(words[:count]) for count in (2, 1) if " ".join(words[:count]) in COMMANDS)
    return COMMANDS[name].make_context(name, words[len(name.split()) :])


def test_every_verb_has_two_examples():
    assert set(EXAMPLES) == set(COMMANDS)
    assert {len(examples) for examples in EXAMPLES.values()} == {2}


@pytest.mark.parametrize("words", EXAMPLES)
def test_the_help_of_a_verb_ends_with_its_examples(rig, words):
    code, said, _ = rig(*words.split(), "--help")
    assert code == 0
    shown = [line.strip() for line in said.splitlines() if line.strip()]
    assert shown[-3:] == ["Examples:", *(f"rig {example}" for example in EXAMPLES[words])]


@pytest.mark.parametrize("words", EXAMPLES)
def test_every_example_is_understood(words):
    for example in EXAMPLES[words]:
        assert example.split()[: len(words.split()[:1])] == words.split()[:1]
        assert parse(example) is not None


@pytest.mark.parametrize("words", QUICK)
def test_the_quick_examples_run(rig, tmp_path, words):
    (tmp_path / "points.csv").write_text("x_m,y_m\n0,0\n0.1,0.05\n0.2,0\n")
    for example in EXAMPLES[words]:
        code, _, told = rig(*shlex.split(example))
        assert code in ((0, 3) if words == "size" else (0,)), told


def test_the_examples_of_a_recorded_run_are_run_one_after_the_other(rig):
    sequence = (
        f"{EXAMPLES['run'][0]} {BRIEF}",
        *EXAMPLES["analyze"],
        EXAMPLES["recover"][0],
        EXAMPLES["export"][0],
        f"{EXAMPLES['sim'][1]} --seconds 0.2",
        *EXAMPLES["track"],
    )
    for example in sequence:
        code, _, told = rig(*shlex.split(example))
        assert code == 0, (example, told)


@pytest.mark.parametrize("words", EXAMPLES)
def test_no_number_of_a_help_text_has_more_digits_than_one_reads(rig, words):
    _, said, _ = rig(*words.split(), "--help")
    assert re.findall(r"\d\.\d{6,}", said) == []
