"""`rig run --planner a,b,c`: one planner that cannot run keeps no other from running."""

import msgspec
import pytest

BRIEF = ["--set", "experiment.quiet_s=0.6", "--set", "experiment.watch_s=2.5"]
RUN = ["run", "--virtual", "--no-report", *BRIEF]


def test_an_infeasible_planner_is_a_row_with_its_reason_and_the_others_run(rig):
    code, said, _ = rig(*RUN, "--planner", "zvd,zv", "--json")
    without, run = msgspec.json.decode(said)["runs"]
    assert code == 0
    assert (without["planner"], without["exit_code"], without["verdict"]) == ("zvd", 3, "bad")
    assert "must be > 2.006067" in without["reasons"][0]
    assert (run["planner"], run["verdict"]) == ("zv", "good")


def test_the_table_of_the_planners_shows_the_reason(rig):
    code, said, _ = rig(*RUN, "--planner", "zv,zvd")
    assert code == 0
    table = said[said.index("residual swing [mrad] by planner") :]
    row = next(line for line in table.splitlines() if "zvd" in line)
    assert "not run: time_s = 1.5; must be > 2.006067" in row


def test_a_plan_beyond_the_limits_is_a_row_too(rig):
    limits = ["--set", "limits.acceleration_m_s2=2.5", "--json"]
    code, said, _ = rig(*RUN, "--planner", "matrix_exponential,zv", *limits)
    without, run = msgspec.json.decode(said)["runs"]
    assert code == 0
    assert "exceeds [limits]" in without["reasons"][0]
    assert run["verdict"] == "good"


def test_a_list_of_which_none_can_run_is_refused(rig, tmp_path):
    code, said, _ = rig(*RUN, "--planner", "zvd,zvdd", "--json")
    assert code == 3
    assert [row["exit_code"] for row in msgspec.json.decode(said)["runs"]] == [3, 3]
    assert not (tmp_path / "runs").exists()


def test_the_code_is_the_highest_of_the_runs(rig):
    blind = ["--set", "bench.camera.contrast=0", "--json"]
    code, said, _ = rig(*RUN, "--planner", "zvd,zv", *blind)
    assert [row["exit_code"] for row in msgspec.json.decode(said)["runs"]] == [3, 5]
    assert code == 5


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--planner", "zv,zvx"], "planner = 'zvx'; did you mean 'zv'?"),
        (["--planner", "zv,zvd", "--set", "model.length_m=-1"], "[model] length_m = -1"),
    ],
)
def test_a_mistake_that_no_planner_could_mend_stops_the_list_before_it_moves(
    rig, tmp_path, words, told
):
    code, _, why = rig(*RUN, *words)
    assert code == 2
    assert told in why
    assert not (tmp_path / "runs").exists()
