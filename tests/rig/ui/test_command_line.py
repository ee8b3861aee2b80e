"""Output, refusals and exit codes of the command line; no mistake gives a stack trace."""

import csv
from pathlib import Path

import msgspec
import pytest

from rig.run.runs import LOG

BRIEF = ["--set", "experiment.quiet_s=0.6", "--set", "experiment.watch_s=2.5"]
JSON_KEYS = {
    "run_id", "run_dir", "mode", "exit_status", "verdict", "reasons", "planner", "move_m",
    "move_time_s", "measured", "sigma", "truth", "planned", "latency_ms", "links", "digest",
}  # fmt: skip
QUANTITIES = {
    "peak_swing_rad",
    "residual_swing_rad",
    "natural_frequency_hz",
    "damping_ratio",
    "cable_length_m",
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Folder of a short run in virtual time."""
    from rig.run import config, experiment

    changes = [word for word in BRIEF if word != "--set"]
    chosen = config.read_experiment("move", changes)
    return experiment.run(
        chosen, "virtual", tmp_path_factory.mktemp("runs"), lambda *_: None, lambda *_: None
    ).folder


def table(name):
    """Rows of a CSV file in the current folder."""
    with Path(name).open() as file:
        return list(csv.DictReader(file))


def test_every_verb_explains_itself(rig):
    verbs = [
        "doctor",
        "plan",
        "compare",
        "laws",
        "spline",
        "motor-check",
        "size",
        "servo",
        "run",
        "stop",
        "sim",
        "track",
        "calibrate",
        "analyze",
    ]
    code, said, _ = rig("--help")
    assert code == 0
    assert all(verb in said for verb in verbs)
    for verb in verbs:
        code, said, _ = rig(verb, "--help")
        assert code == 0, verb
        assert "Usage" in said


def test_a_run_prints_one_json_document_with_the_promised_keys_and_nothing_else(rig):
    code, said, _ = rig("run", "move", "--virtual", "--json", *BRIEF)
    document = msgspec.json.decode(said)
    assert (code, document["exit_status"], document["verdict"]) == (0, "ok", "good")
    assert set(document) >= JSON_KEYS
    assert all(set(document[name]) >= QUANTITIES for name in ("measured", "sigma", "truth"))
    assert set(document["planned"]) >= {"peak_swing_rad", "residual_swing_rad"}
    assert set(document["latency_ms"]) >= {"command", "vision"}
    for row in document["links"].values():
        assert row["sent"] == row["delivered"] + row["lost"] + sum(row["rejected"].values())
        assert set(row) >= {"sent", "delivered", "lost", "duplicated", "late", "rejected"}
    assert {p.name for p in Path(document["run_dir"]).iterdir()} == {"run.mcap", "report.html"}


def test_a_run_shows_its_plan_first_and_a_table_last(rig):
    code, said, before = rig("run", "--virtual", "--no-report", *BRIEF)
    assert code == 0
    assert "predicted swing" in before
    assert "cable length" in said
    assert "verdict: good" in said


def test_two_planners_are_run_one_after_the_other_and_compared(rig):
    code, said, _ = rig(
        "run", "--virtual", "--no-report", "--json", "--planner", "matrix_exponential,zv", *BRIEF
    )
    runs = msgspec.json.decode(said)["runs"]
    assert code == 0
    assert [run["planner"] for run in runs] == ["matrix_exponential", "zv"]


def test_the_report_is_one_file_that_needs_nothing_else(rig):
    _, said, _ = rig("run", "--virtual", "--json", *BRIEF)
    page = (Path(msgspec.json.decode(said)["run_dir"]) / "report.html").read_text()
    assert page.count("<svg") == 4  # three figures, and the drawing on the camera image
    assert "data:image/jpeg;base64" in page
    assert "<script" not in page
    assert "http" not in page
    assert "<link" not in page


def test_a_plan_in_json_has_the_keys_that_scripts_rely_on(rig):
    code, said, _ = rig(
        "plan", "--planner", "zv", "--distance", "0.2", "--time", "1.5", "--length", "1", "--json"
    )
    document = msgspec.json.decode(said)
    assert (code, document["planner"], document["status"]) == (0, "zv", "ok")
    assert {
        "model",
        "robust",
        "distance_m",
        "time_s",
        "residual_swing_nonlinear_rad",
        "travel_m",
        "compute_s",
    } <= set(document)


def test_a_plan_is_written_as_csv_every_ten_milliseconds(rig, tmp_path):
    rig("plan", "--time", "1.5", "--csv", tmp_path / "plan.csv")
    rows = table("plan.csv")
    assert len(rows) == 151
    assert float(rows[-1]["position_m"]) == pytest.approx(0.2)


def test_a_synthetic_video_is_tracked_to_its_truth(rig):
    code, said, _ = rig(
        "sim",
        "--video",
        "v.avi",
        "--truth",
        "t.csv",
        "--seconds",
        "1",
        "--set",
        "bench.camera.pitch_deg=0",
        "--json",
    )
    told = msgspec.json.decode(said)
    assert (code, told["frames"]) == (0, 50)
    code, _, _ = rig("track", "v.avi", "--csv", "a.csv")
    seen, true = table("a.csv"), table("t.csv")
    assert code == 0
    errors = [
        float(a["angle_rad"]) - float(b["angle_rad"]) for a, b in zip(seen, true, strict=True)
    ]
    assert max(map(abs, errors)) < 0.1e-3


def test_equal_seeds_give_equal_videos(rig, tmp_path):
    for name in ("a", "b"):
        rig(
            "sim",
            "--video",
            f"{name}.avi",
            "--truth",
            f"{name}.csv",
            "--seconds",
            "0.2",
            "--seed",
            "7",
        )
    assert (tmp_path / "a.avi").read_bytes() == (tmp_path / "b.avi").read_bytes()
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()


def test_analyze_gives_the_result_of_the_run(rig, recorded):
    code, said, _ = rig("analyze", recorded, "--json", "--csv", "swing.csv")
    assert code == 0
    assert msgspec.json.decode(said)["run_id"] == recorded.name
    assert len(table("swing.csv")) > 100


def test_the_shipped_calibration_is_what_the_command_makes(rig):
    from rig.run import config
    from rig.run.calibration import file as calibration_file
    from rig.run.cameras import cameras

    code, said, _ = rig("calibrate", "offsets", "--virtual", "--json", "--out", "again.toml")
    made = msgspec.json.decode(said)["calibration"]
    chosen = config.read_experiment("move", [])
    _, shipped = calibration_file.find(chosen, cameras(chosen)[0])
    assert code == 0
    assert made["offset_rad"] == pytest.approx(shipped.offset_rad, abs=5e-6)
    assert made["pixels_per_m"] == pytest.approx(shipped.pixels_per_m, abs=0.05)
    assert made["pivot_home_px"] == pytest.approx(shipped.pivot_home_px, abs=0.3)


def test_the_doctor_finds_this_machine_and_this_program(rig):
    code, said, _ = rig("doctor", "--json")
    checks = {c["name"]: c for c in msgspec.json.decode(said)["checks"]}
    assert code == 0
    assert checks["package vision"]["status"] == "ok"
    assert "late by" in checks["timer"]["found"]


MISTAKES = {
    "an experiment that is not there": (["run", "moove"], 2, "did you mean 'move'?"),
    "a misspelt key": (["run", "--set", "move.distanse_m=0.1"], 2, "did you mean 'distance_m'?"),
    "a misspelt section": (["run", "--set", "benhc.x=1"], 2, "did you mean 'bench'?"),
    "a plant parameter out of bounds": (
        ["run", "--set", "bench.pendulum.length_m=-1"], 2, "[bench.pendulum] length_m = -1",
    ),
    "a misspelt plant parameter": (
        ["run", "--set", "bench.camera.pich_deg=1"], 2, "did you mean 'pitch_deg'?",
    ),
    "a planner that is not there": (["run", "--planner", "zvv"], 2, "zv"),
    "a plan that leaves the workspace": (
        ["run", "--set", "move.distance_m=0.3"], 3, "-0.25 to 0.25 m",
    ),
    "a plan that leaves the limits": (["run", "--set", "move.time_s=0.8"], 3, "limit"),
    "a shaper that has no time": (["plan", "--planner", "zv", "--time", "0.9"], 2, "1.00"),
    "a plan without time": (["plan", "--time", "0"], 2, "must be > 0"),
    "a run that is not there": (["analyze", "nothing"], 2, "no such run"),
    "a video that is not there": (["track", "none.avi", "--pivot", "1,2"], 2, "no such file"),
    "a pivot that is none": (["track", "none.avi", "--pivot", "left"], 2, "must be X,Y"),
    "a calibration that is not there": (
        ["run", "--set", "vision.calibration=x.toml"], 2, "no such file",
    ),
    "a planner list without a name": (["run", "--planner", ","], 2, "must name one or more"),
    "an option that is none": (["run", "--virtuel"], 2, "virtuel"),
    "a stop of nothing": (["stop"], 2, "nothing is running"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_gets_a_message_and_its_exit_code(rig, mistake):
    words, expected, hint = MISTAKES[mistake]
    code, _, said = rig(*words)
    assert code == expected, said
    assert hint in said.replace("\n", " ")


def test_a_mistake_in_json_mode_is_a_json_document_too(rig):
    code, said, _ = rig("run", "--json", "--set", "move.time_s=0.8")
    document = msgspec.json.decode(said)
    assert (code, document["exit_code"], document["verdict"]) == (3, 3, "bad")


def test_a_broken_experiment_file_is_named_with_its_line(rig, tmp_path):
    (tmp_path / "mine.toml").write_text("[experiment\nname = 1\n")
    code, _, said = rig("run", "mine.toml")
    assert code == 2
    assert "line 1" in said


def test_a_file_that_is_no_log_is_distinguished_from_a_truncated_log(rig, recorded, tmp_path):
    (tmp_path / "noise.mcap").write_bytes(b"not a log" * 100)
    code, _, said = rig("analyze", "noise.mcap")
    assert (code, "not an MCAP file" in said) == (6, True)
    whole = (recorded / LOG).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    code, said, _ = rig("analyze", "cut.mcap", "--json")
    document = msgspec.json.decode(said)
    assert (code, document["verdict"]) == (6, "bad")
    assert "incomplete" in " ".join(document["reasons"])
    assert document["frames"] > 50


def test_a_load_that_already_swings_is_refused_with_its_amplitude_unless_allowed(rig):
    swinging = [
        "run",
        "--virtual",
        "--no-report",
        "--json",
        *BRIEF,
        "--set",
        "bench.pendulum.initial_swing_rad=0.03",
    ]
    code, said, _ = rig(*swinging)
    document = msgspec.json.decode(said)
    assert (code, document["exit_status"]) == (3, "stopped")
    assert "swings" in document["reasons"][0]
    assert "safety.initial_swing_rad" in document["reasons"][0]
    code, said, _ = rig(*swinging, "--set", "safety.initial_swing_rad=0.1")
    assert (code, msgspec.json.decode(said)["exit_status"]) == (0, "ok")


def test_a_video_without_a_cable_is_not_taken_for_one_with(rig):
    rig(
        "sim",
        "--video",
        "v.avi",
        "--truth",
        "t.csv",
        "--seconds",
        "0.2",
        "--set",
        "bench.camera.contrast=0",
    )
    code, said, _ = rig("track", "v.avi", "--pivot", "320,-40")
    assert code == 6
    assert "no line stands out" in said


def test_a_camera_that_sees_nothing_stops_the_move_as_a_fault(rig):
    code, said, _ = rig(
        "run", "--virtual", "--no-report", "--json", *BRIEF, "--set", "bench.camera.contrast=0"
    )
    document = msgspec.json.decode(said)
    assert (code, document["exit_status"]) == (5, "fault")
    assert "no valid cable angle" in document["reasons"][0]


BARS = [
    "--links",
    "0.5:3.375:bar,0.5:3.375:bar",
    "--stiffness",
    "10",
    "--joint-damping",
    "2.214e-4",
]
PLAN_KEYS = [
    "planner", "model", "robust", "distance_m", "time_s", "peak_swing_rad", "residual_swing_rad",
    "residual_swing_nonlinear_rad", "peak_speed_m_s", "rms_speed_m_s", "peak_acceleration_m_s2",
    "rms_acceleration_m_s2", "travel_m", "acceleration_continuous", "compute_s", "status",
]  # fmt: skip


def test_a_chain_is_planned_robustly_and_drawn(rig):
    code, said, _ = rig(
        "plan",
        *BARS,
        "--model",
        "jerk",
        "--robust",
        "length_2",
        "--time",
        2,
        "--plot",
        "plan.svg",
        "--json",
    )
    document = msgspec.json.decode(said)
    assert code == 0
    assert list(document)[: len(PLAN_KEYS)] == PLAN_KEYS
    assert (document["model"], document["robust"], document["acceleration_continuous"]) == (
        "jerk",
        ["length_2"],
        True,
    )
    assert document["peak_acceleration_m_s2"] == pytest.approx(
        2.3073, rel=1e-4
    )  # source 004, table 4.6, exact
    assert document["residual_swing_rad"] < 1e-11
    assert Path("plan.svg").read_text().count("<svg") == 1


def test_a_plan_starts_from_a_swinging_load_and_weighs_states(rig):
    code, said, _ = rig(
        "plan", "--start", "angle_rad=0.05", "--weight", "angle_rad=500", "--time", 1.8, "--json"
    )
    document = msgspec.json.decode(said)
    assert code == 0
    assert document["peak_swing_rad"] >= 0.05
    assert document["residual_swing_rad"] < 1e-9


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--robust", "lenght"], "parameter in robust = 'lenght'; did you mean 'length'?"),
        (["--robust", "length_1"], "parameter in robust = 'length_1'; did you mean 'length'?"),
        (["--links", "0.5:3:rod"], "kind of a link = 'rod'; must be one of bar, point"),
        (["--links", "0.5"], "link = '0.5'; must be length:mass:kind in m and kg"),
        (
            ["--links", "0.5:1:bar", "--length", "1"],
            "--length 1 with --links 0.5:1:bar; must be one of the two",
        ),
        (["--stiffness", "3"], "stiffness_n_m_rad = [3.0] without links"),
        ([*BARS[:2], "--stiffness", "1,2"], "stiffness_n_m_rad: 2 values; must be 1"),
        (["--stiffness", "much"], "--stiffness 'much'; must be numbers separated by commas"),
        (["--start", "angle_rad"], "--start 'angle_rad'; must be state=value"),
        (
            ["--model", "torque"],
            "input = 'torque'; did you mean 'force'? must be one of acceleration, force, jerk",
        ),
        (["--time", "nan"], "time_s = nan; must be > 0 and finite"),
        (
            ["--nonlinear"],
            "nonlinear = True for matrix_exponential; must be False: take collocation",
        ),
        (["--planner", "zvd", "--time", "2"], "time_s = 2.0; must be > 2.006067"),
        (["--plot", "plan.doc"], "--plot 'plan.doc'; must end in one of .svg, .png, .pdf"),
    ],
)
def test_an_invalid_plan_is_refused_by_name(rig, words, told):
    code, said, why = rig("plan", *words)
    assert (code, said) == (2, "")
    assert told in why


def test_a_chain_is_not_run_on_a_bench_with_one_link(rig):
    code, _, why = rig(
        "run", "move", "--virtual", "--set", 'model.links=["0.5:3.375:bar", "0.5:3.375:bar"]'
    )
    assert code == 3
    assert "[model] has 2 links, the load of [bench] has 1" in why


@pytest.mark.parametrize(
    "planner",
    ["finite_differences", "shooting", "collocation", "convolution", "zvd", "ei", "zv_joint"],
)
def test_every_kind_of_planner_runs_on_the_rig(rig, planner):
    limits = ["--set", "move.time_s=2.6", "--set", "move.distance_m=0.1"]
    code, said, _ = rig(
        "run", "move", "--virtual", "--no-report", "--json", "--planner", planner, *BRIEF, *limits
    )
    document = msgspec.json.decode(said)
    assert (code, document["planner"], document["verdict"]) == (0, planner, "good")


def test_a_robust_jerk_plan_is_an_experiment(rig):
    words = [
        "--set",
        'plan.input="jerk"',
        "--set",
        'plan.robust=["length"]',
        "--set",
        "move.time_s=2.5",
    ]
    code, said, _ = rig("run", "move", "--virtual", "--no-report", "--json", *BRIEF, *words)
    document = msgspec.json.decode(said)
    assert (code, document["verdict"]) == (0, "good")
    assert (
        document["truth"]["residual_swing_rad"] < 0.4e-3
    )  # the plain plan leaves 1.6 mrad on a cable 2 cm shorter


def test_a_published_table_is_shown_with_its_verdicts(rig):
    code, said, _ = rig("compare", "3.7", "--csv", "rows.csv")
    assert code == 0
    assert "reproduced" in said
    assert "not the minimiser" in said
    rows = table("rows.csv")
    assert {row["technique"] for row in rows} >= {"ZVD", "DF Rob", "bvp5c Rob", "Shooting Rob"}
    code, said, _ = rig("compare", "3.7", "--json")
    document = msgspec.json.decode(said)
    assert code == 0
    assert all(row["as_expected"] for row in document["rows"])
    assert rig("compare", "3.9")[0] == 2


@pytest.mark.parametrize(
    ("planner", "changes"),
    [
        (
            "law",
            ['plan.law="modified_sine"', "move.time_s=3.3637"],
        ),  # leaves no swing of this cable by itself
        ("zv", ['plan.law="quintic"', 'plan.input="jerk"']),
        ("zvd", ['plan.law="double_s"']),
    ],
)
def test_any_law_runs_on_the_rig_unshaped_or_shaped(rig, planner, changes):
    words = [
        word
        for change in ["move.time_s=2.6", "model.length_m=0.98", *changes]
        for word in ("--set", change)
    ]
    code, said, _ = rig(
        "run", "move", "--virtual", "--no-report", "--json", "--planner", planner, *BRIEF, *words
    )
    document = msgspec.json.decode(said)
    assert (code, document["planner"], document["verdict"]) == (0, planner, "good")
    assert document["truth"]["residual_swing_rad"] < 1e-3


@pytest.mark.parametrize(
    ("verb", "units"),
    [
        (("motor-check",), ("torque of the motor [N m]", "rotor [kg m²]", "motion [s]")),
        (("plan",), ("Distance [m]", "joint between links [N m/rad]", "limit [m/s²]")),
        (("spline",), ("Speed limit [m/s]", "Jerk limit [m/s³]")),
        (("servo", "notch"), ("[rad/s]", "the [model] of a comparison")),
    ],
)
def test_the_help_of_an_option_shows_its_unit(rig, verb, units):
    """A unit that starts with a lower-case letter must be escaped, or it is read as markup."""
    _, text, _ = rig(*verb, "--help")
    words = " ".join(text.replace("│", " ").split())
    assert all(unit in words for unit in units), words


def test_no_help_text_of_an_option_starts_with_a_preposition():
    from rig.ui.cli.verbs import SERVO_VERBS, STUDY_VERBS, VERBS, load

    prepositions = ("Of", "At", "In", "With", "About", "Beside", "From", "For", "What", "Whose")
    pending = [load(name, verb) for name, verb in {**VERBS, **SERVO_VERBS, **STUDY_VERBS}.items()]
    texts = []
    while pending:
        command = pending.pop()
        pending.extend(getattr(command, "commands", {}).values())
        texts += [getattr(param, "help", "") or "" for param in command.params]
    assert len(texts) > 100
    assert [text for text in texts if text.split()[:1] and text.split()[0] in prepositions] == []
