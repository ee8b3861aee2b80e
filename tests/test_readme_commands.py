"""Every command of the README ends with the exit code that the README gives."""

import os
import re
import threading
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest
import shellingham
import zmq

from rig.run import doctor, machine

README = (Path(__file__).resolve().parents[1] / "README.md").read_text()
TABLE_ROW = re.compile(r"^\| `rig ([^`]+)` \| (\d) \| (.*) \|$", re.MULTILINE)
CODE_SPAN = re.compile(r"`rig ([^`]+)`")
CODE_BLOCK = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)
CODE_LINE = re.compile(r"^(?:\$ )?(?:\.venv/bin/)?rig ([^#\n]*[^#\s])", re.MULTILINE)
BRIEF = ("--set", "experiment.quiet_s=0.6", "--set", "experiment.watch_s=2.5")
OUTPUT_OPTIONS = ("--plot", "--csv", "--video", "--truth")
REQUEST_WAIT_MS = 10_000  # far beyond what a request on the loopback needs


class Example(NamedTuple):
    """A command of the README."""

    words: tuple[str, ...]  # after `rig`
    exit_code: int
    is_in_real_time: bool


def read_examples():
    """Commands of the README by their text; 0 where the README gives no exit code."""
    found = {}
    for text, code, result in TABLE_ROW.findall(README):
        found[text] = Example(tuple(text.split()), int(code), "in real time" in result)
    blocks = "".join(CODE_BLOCK.findall(README))
    for text in [*CODE_SPAN.findall(README), *CODE_LINE.findall(blocks)]:
        found.setdefault(text, Example(tuple(text.split()), 0, False))
    return found


EXAMPLES = read_examples()


# Preparations: what a command finds in its folder


def keep_time(rig, monkeypatch):
    """Take the timer of this machine as exact, instead of measuring it."""
    timely = machine.grade_of(None, machine.lateness_of([0]))
    examine = partial(doctor.examine, measure=lambda: timely)
    monkeypatch.setattr("rig.ui.cli.doctor.examine", examine)


def write_points(rig, monkeypatch):
    Path("points.csv").write_text("x_m\n0\n0.5\n0.2\n1\n")


def record_run(rig, monkeypatch):
    assert rig("run", "move", "--virtual", "--no-report", *BRIEF)[0] == 0


def damage_log(rig, monkeypatch):
    record_run(rig, monkeypatch)
    (log,) = Path("runs").glob("*/run.mcap")
    data = log.read_bytes()
    Path("BROKEN.mcap").write_bytes(data[: len(data) * 2 // 3])


def render_video(rig, monkeypatch):
    assert rig("sim", "--video", "v.avi", "--truth", "t.csv", "--seconds", "0.2")[0] == 0


def render_boards(rig, monkeypatch):
    words = ("--scene", "chessboard", "--frames", "8", "--video", "boards.avi", "--truth", "t.csv")
    assert rig("sim", *words)[0] == 0


def start_operator(rig, monkeypatch):
    """Answer a stop and the question after it, as the operator of a run does."""
    context = zmq.Context()
    socket = context.socket(zmq.REP)
    port = socket.bind_to_random_port("tcp://127.0.0.1")
    folder = Path("runs/now")
    folder.mkdir(parents=True)
    fields = {"address": f"tcp://127.0.0.1:{port}", "pid": os.getpid()}
    (folder / "operator.json").write_bytes(msgspec.json.encode(fields))

    def answer():
        for expected, text in (
            (b"stop", b"ordered, was running"),
            (b"status", b'{"at_rest":true}'),
        ):
            if socket.poll(REQUEST_WAIT_MS):
                socket.send(text if socket.recv() == expected else b"refused")
        context.destroy()

    threading.Thread(target=answer).start()


def use_bash_in_this_folder(rig, monkeypatch):
    monkeypatch.setenv("HOME", str(Path.cwd()))
    monkeypatch.setattr(shellingham, "detect_shell", lambda: ("bash", "/bin/bash"))


PREPARATIONS = {
    "doctor": keep_time,
    "spline": write_points,
    "track": render_video,
    "calibrate": render_boards,
    "analyze": record_run,
    "identify": record_run,
    "export": record_run,
    "recover": damage_log,
    "stop": start_operator,
    "--install-completion": use_bash_in_this_folder,
}


def files_written_by(words):
    """Names that follow an option for an output."""
    return [name for option, name in pairwise(words) if option in OUTPUT_OPTIONS]


@pytest.mark.parametrize("text", EXAMPLES)
def test_a_command_of_the_readme_ends_with_its_exit_code_and_writes_its_files(
    rig, monkeypatch, text
):
    example = EXAMPLES[text]
    words = ["last" if word == "RUN" else word for word in example.words]
    if example.is_in_real_time:
        words.append("--virtual")
    prepare = PREPARATIONS.get(words[0])
    if prepare is not None:
        prepare(rig, monkeypatch)
    code, said, why = rig(*words)
    assert code == example.exit_code, said + why
    assert [name for name in files_written_by(words) if not Path(name).exists()] == []


def test_a_stop_with_nothing_running_exits_as_the_readme_says(rig):
    (result,) = [result for text, _, result in TABLE_ROW.findall(README) if text == "stop"]
    assert "2 if nothing runs" in result
    assert rig("stop")[0] == 2


def test_every_line_of_the_table_of_commands_has_an_exit_code():
    lines = [line for line in README.splitlines() if line.startswith("| `rig ")]
    assert len(lines) == len(TABLE_ROW.findall(README)) > 20


def test_a_command_that_takes_real_time_says_so():
    moving = [e for e in EXAMPLES.values() if e.words[0] in ("run", "calibrate")]
    started = [e for e in moving if "--list" not in e.words and "camera" not in e.words]
    assert all(("--virtual" in e.words) != e.is_in_real_time for e in started)
