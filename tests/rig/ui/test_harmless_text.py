"""Text of files cannot steer the terminal: escape codes of logs and TOML keys are removed."""

import pytest

from rig.analysis.summary import Latency, LinkSummary, Planned, Quantities, Summary
from rig.ui.cli.output import print_summary

EVIL = "\x1b[2J\x1b]0;title\x07\x9b31m\u202e"


def harmless(text):
    """Whether a text holds no control character but tab and line feed."""
    return not any(
        (ord(letter) < 32 and letter not in "\t\n") or 127 <= ord(letter) < 160
        or letter in "\u202e" for letter in text
    )  # fmt: skip


def test_a_summary_of_a_hostile_log_is_printed_without_control_characters(capsys):
    link = LinkSummary(
        sent=1, delivered=0, lost=0, duplicated=0, late=0, superseded=0, foreign=0,
        rejected={f"why{EVIL}": 1}, lost_link=0, lost_kernel=0, lost_queue=0, unexplained=0,
    )  # fmt: skip
    summary = Summary(
        run_id="1", run_dir="x", mode=f"virtual{EVIL}", experiment=f"name{EVIL}",
        exit_status=f"ok{EVIL}", exit_code=6, verdict="bad", reasons=[f"reason{EVIL}"],
        planner=f"zv{EVIL}", move_m=0.2, move_time_s=1.5, measured=Quantities(),
        sigma=Quantities(), truth=None, planned=Planned(), latency_ms=Latency(),
        links={f"link{EVIL}": link}, digest=None, events=[f"event{EVIL}"],
        cpu_share={f"task{EVIL}": 0.1},
    )  # fmt: skip
    print_summary(summary)
    said = capsys.readouterr().out
    assert harmless(said)
    for word in ("virtual", "name", "ok", "reason", "zv", "link", "event", "why", "task"):
        assert f"{word}[2J" in said.replace("\n", "")


@pytest.mark.parametrize(
    "text",
    [
        'experiment.name = "x"\n"\\u001b[31mkey" = 1\n',
        '[experiment]\nname = "\\u001b[2J\\u0007"\n',
        '[experiment]\nname = "x"\nplanner = "\\u009b31m"\n',
    ],
)
def test_a_hostile_experiment_file_is_refused_without_control_characters(rig, tmp_path, text):
    (tmp_path / "evil.toml").write_text(text)
    code, said, why = rig("run", "--virtual", "evil.toml")
    assert code == 2
    assert harmless(said + why)


def test_a_hostile_purpose_of_a_run_reaches_no_terminal(rig):
    brief = ["--set", "experiment.quiet_s=0.6", "--set", "experiment.watch_s=2.5"]
    escaped = "".join(f"\\u{ord(letter):04x}" for letter in EVIL)
    purpose = f'experiment.purpose="{escaped}"'
    code, said, why = rig("run", "--virtual", "--no-report", *brief, "--set", purpose)
    assert code == 0
    assert harmless(said + why)


def test_a_hostile_name_of_a_log_is_printed_without_control_characters(rig, tmp_path):
    evil = tmp_path / "a\x1b[2Jb.mcap"
    evil.write_bytes(b"no log")
    code, said, why = rig("analyze", evil)
    assert code == 6
    assert harmless(said + why)
