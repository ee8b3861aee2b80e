"""Tables and lines on the terminal: what fits, what is dropped, what is folded."""

import csv
import shlex
from pathlib import Path

import pytest

from rig.ui.cli import page
from rig.ui.cli.page import Column, plain_table, print_command, print_paragraph, print_table

BRIEF = ["--set", "experiment.quiet_s=0.6", "--set", "experiment.watch_s=2.5"]
POINTS = "x_m,y_m\n0,0\n0.1,0.05\n0.2,0\n"


@pytest.fixture
def columns(monkeypatch):
    """Set the width of the page."""
    return lambda count: monkeypatch.setenv("COLUMNS", str(count))


def wide_table():
    table = plain_table(
        "widths",
        ("name", Column("second\n[m]", drop=2), Column("third", drop=3), Column("first", drop=1)),
    )
    table.add_row("a", "2" * 20, "3" * 20, "1" * 20)
    return table


def test_a_table_that_fits_keeps_all_its_columns(columns, capsys):
    columns(80)
    print_table(wide_table())
    said = capsys.readouterr().out
    assert all(digit * 20 in said for digit in "123")
    assert "dropped" not in said


def test_columns_are_dropped_in_their_order_and_named_in_it(columns, capsys):
    columns(40)
    print_table(wide_table())
    said = capsys.readouterr().out
    assert "3" * 20 in said
    assert "1" * 20 not in said
    assert "2" * 20 not in said
    told = " ".join(said.split())
    assert told.endswith(
        "dropped for 40 columns, in this order: first; second. "
        "A wider terminal or --json shows them."
    )


def test_a_table_into_a_file_is_whole(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    table = plain_table("file", ("name", Column("a", drop=1), Column("b", drop=2)))
    table.add_row("x", "1" * 60, "2" * 60)
    print_table(table)
    assert "1" * 60 + "  " + "2" * 60 in capsys.readouterr().out


def test_a_column_that_folds_is_folded_before_any_is_dropped(columns, capsys):
    columns(40)
    table = plain_table("folds", ("name", Column("text", folds=True), Column("n", drop=1)))
    table.add_row("x", "one two three four five six seven", "1" * 12)
    print_table(table)
    said = capsys.readouterr().out
    assert "1" * 12 in said
    assert "seven" in said
    assert max(map(len, said.splitlines())) <= 40


def test_a_table_that_cannot_fit_is_wider_than_the_page_and_loses_no_digit(columns, capsys):
    columns(30)
    table = plain_table("wide", ("name", "number", Column("text", folds=True)))
    table.add_row("x", "1234567890" * 4, "some words")
    print_table(table)
    assert "1234567890" * 4 in capsys.readouterr().out


@pytest.mark.parametrize("count", [40, 60])
def test_no_digit_of_a_run_is_lost_on_a_narrow_page(rig, columns, count):
    columns(160)
    _, whole, _ = rig("run", "--virtual", "--no-report", *BRIEF)
    row = next(line for line in whole.splitlines() if "natural frequency" in line)
    measured = row.split("│")[3].strip()
    columns(count)
    _, narrow, _ = rig("run", "--virtual", "--no-report", *BRIEF)
    assert measured in narrow


def test_a_paragraph_folds_between_words_and_not_within_a_unit(columns, capsys):
    columns(30)
    print_paragraph("the torque at the motor is 20 N m or less", indent="  ")
    assert capsys.readouterr().out.splitlines() == [
        "the torque at the motor is 20",
        "  N m or less",
    ]


def test_a_long_command_can_be_pasted_as_it_is_printed(columns, capsys):
    columns(60)
    command = "rig run move --set 'experiment.purpose=two words' --planner matrix_exponential,zv"
    print_command("try it:", command)
    label, *lines = capsys.readouterr().out.splitlines()
    assert label == "try it:"
    assert max(map(len, lines)) <= 60
    assert len(lines) > 1
    pasted = "".join(line.removesuffix("\\") for line in lines)
    assert shlex.split(pasted) == shlex.split(command)


@pytest.mark.parametrize("letter", ["\x1b", "\x07", "\x9b", "\u202e"])
def test_no_text_of_a_table_or_a_line_steers_the_terminal(columns, capsys, letter):
    columns(80)
    table = plain_table(f"ti{letter}tle", (f"he{letter}ad", "b"))
    table.add_row(f"ce{letter}ll", f"{letter}")
    print_table(table)
    page.out.print(f"li{letter}ne")
    page.err.print(f"er{letter}ror")
    said = capsys.readouterr()
    assert letter not in said.out + said.err
    assert all(word in said.out for word in ("title", "head", "cell", "line"))
    assert "error" in said.err


def test_words_between_colons_are_no_pictures(capsys):
    page.out.print("length:mass:kind, 0.5:key:bar")
    assert capsys.readouterr().out == "length:mass:kind, 0.5:key:bar\n"


# the commands of the README, but for pictures and real time
COMMANDS = {
    "doctor": "doctor",
    "plan": "plan --planner zv --time 2 --length 0.98",
    "plan of a chain": "plan --links 0.5:3.4:bar,0.5:3.4:bar --stiffness 10 --model jerk "
    "--robust length_2 --time 3",
    "compare": "compare 3.1",
    "laws": "laws",
    "laws, published": "laws --published",
    "laws compare": "laws compare",
    "spline": "spline points.csv --vmax 3 --amax 2",
    "motor-check": "motor-check --example 1",
    "size": "size --example appendix",
    "servo compare": "servo compare --truth listed",
    "servo notch": "servo notch",
    "servo observer": "servo observer",
    "servo shaping": "servo shaping --sample-time 0.001",
    "run": "run move --virtual --seed 7 --no-report",
    "dropouts": "run dropouts --virtual --no-report",
    "planners": "run --planner matrix_exponential,zv,zvd --virtual --no-report",
    "a key": "run --virtual --no-report --set bench.pendulum.length_m=0.9 --set move.time_s=2",
    "sim": "sim --video v.avi --truth t.csv --seconds 0.2",
    "calibrate": "calibrate offsets --virtual",
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_verb_fits_eighty_columns(rig, columns, tmp_path, name):
    (tmp_path / "points.csv").write_text(POINTS)
    columns(80)
    code, said, told = rig(*shlex.split(COMMANDS[name]))
    lines = (said + told).splitlines()
    assert code == (3 if name == "size" else 0)
    assert [line for line in lines if len(line) > 80] == []
    assert [line for line in lines if "…" in line] == []


def test_analyze_and_track_fit_eighty_columns(rig, columns):
    columns(80)
    rig("run", "--virtual", "--no-report", *BRIEF)
    rig("sim", "--video", "v.avi", "--truth", "t.csv", "--seconds", "0.2")
    for words in (["analyze", "last"], ["track", "v.avi"]):
        code, said, told = rig(*words)
        assert code == 0
        assert [line for line in (said + told).splitlines() if len(line) > 80] == []


WRITTEN = {
    "plan": (["plan", "--csv", "a.csv", "--plot", "b.svg"], ["a.csv", "b.svg"]),
    "spline": (
        ["spline", "points.csv", "--time", "1", "--csv", "a.csv", "--plot", "b.svg"],
        ["a.csv", "b.svg"],
    ),
    "compare": (["compare", "3.7", "--csv", "a.csv"], ["a.csv"]),
    "motor-check": (["motor-check", "--example", "1", "--plot", "b.svg"], ["b.svg"]),
    "size": (["size", "--example", "appendix", "--plot", "b.svg"], ["b.svg"]),
    "notch": (["servo", "notch", "--plot", "b.svg"], ["b.svg"]),
    "observer": (["servo", "observer", "--plot", "b.svg"], ["b.svg"]),
    "shaping": (["servo", "shaping", "--plot", "b.svg"], ["b.svg"]),
    "servo compare": (["servo", "compare", "--truth", "listed", "--plot", "b.svg"], ["b.svg"]),
    "laws plot": (["laws", "plot", "cubic", "--plot", "b.svg"], ["b.svg"]),
    "sim": (
        ["sim", "--video", "v.avi", "--truth", "t.csv", "--seconds", "0.2"],
        ["v.avi", "t.csv"],
    ),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_every_file_that_is_written_is_named(rig, tmp_path, name):
    (tmp_path / "points.csv").write_text(POINTS)
    words, files = WRITTEN[name]
    _, said, _ = rig(*words)
    assert all(Path(file).is_file() for file in files)
    assert all(file in said for file in files)


def test_a_document_names_no_file_outside_itself(rig):
    _, said, _ = rig("plan", "--csv", "a.csv", "--json")
    assert said.startswith("{")
    assert said.rstrip().endswith("}")
    assert "written" not in said


def test_the_swing_the_report_and_the_tables_of_a_run_are_named(rig):
    rig("run", "--virtual", "--no-report", *BRIEF)
    _, said, _ = rig("analyze", "last", "--csv", "swing.csv", "--report")
    assert "written: swing.csv" in said
    assert "report.html" in said
    code, said, _ = rig("export", "last", "--csv", "tables")
    assert code == 0
    assert "tables written to tables" in said
    with Path("tables/angle_1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert int(rows[0]["rows"]) > 0  # of the image, in each message; not a batch of receipts
