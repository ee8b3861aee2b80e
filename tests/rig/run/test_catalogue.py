"""The catalogue of the shipped experiments, and what those of source 004 have in common."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from rig.run import catalogue, config

FOLDER = Path(config.__file__).parent / "experiments"
ROWS = {row.name: row for row in catalogue.shipped_experiments()}
SOURCE_004 = [name for name in ROWS if name.startswith("source004_")]
LINKS = [name for name in SOURCE_004 if name.startswith(("source004_ch4_", "source004_ch5_"))]
CABLE = [name for name in SOURCE_004 if name not in LINKS]
MOVES = [name for name in CABLE if name != "source004_free_decay"]
OTHER_MODES = ("source004_ch4_2s5_axis_free", "source004_ch4_2s5_axis_tuned")  # of the planner
MEASURED_CABLE_M = 0.9624  # source 004, section 3.4.1
MEASURED_DAMPING_RATIO = 0.000237
TIMES_S = {"2s": 2.0, "2s5": 2.5, "1s5": 1.5, "1s1": 1.1, "0s75": 0.75}
SHORTER_M = {"6cm": 0.06, "18cm": 0.18}


def tables(name: str) -> dict[str, Any]:
    """Read the tables of a shipped file, without the defaults."""
    return tomllib.loads((FOLDER / f"{name}.toml").read_text())


def test_the_catalogue_has_a_row_for_every_shipped_file() -> None:
    assert sorted(ROWS) == sorted(path.stem for path in FOLDER.glob("*.toml"))


@pytest.mark.parametrize("name", ROWS)
def test_every_experiment_has_a_purpose_of_one_line(name: str) -> None:
    purpose = ROWS[name].purpose
    assert 10 < len(purpose) <= 72
    assert "\n" not in purpose
    assert purpose == tables(name)["experiment"]["purpose"]


def test_a_row_states_the_move_of_its_kind() -> None:
    move, joint, free = ROWS["move"], ROWS["joint_1"], ROWS["free_decay"]
    assert (move.distance_m, move.time_s, move.planner) == (0.2, 1.5, "matrix_exponential")
    assert (joint.load_angle_deg, joint.time_s, joint.planner) == (40.0, 0.5, None)
    assert (free.distance_m, free.time_s, free.planner) == (None, None, None)


def test_the_experiments_of_source_004_are_all_there() -> None:
    assert (len(CABLE), len(LINKS)) == (24, 10)
    assert len({ROWS[name].purpose for name in SOURCE_004}) == 34


@pytest.mark.parametrize("name", CABLE)
def test_the_planner_knows_the_measured_cable_and_the_name_tells_the_plant(name: str) -> None:
    file = tables(name)
    _, _, suffix = name.partition("-")
    plant = file["bench"]["pendulum"]
    shorter_m = MEASURED_CABLE_M - plant["length_m"]
    assert file["model"] == {"length_m": MEASURED_CABLE_M, "damping_ratio": 0.0}
    assert shorter_m == pytest.approx(SHORTER_M.get(suffix, 0.0), abs=1e-9)
    assert plant["damping_ratio"] == MEASURED_DAMPING_RATIO


@pytest.mark.parametrize("name", MOVES)
def test_the_name_tells_time_input_and_method(name: str) -> None:
    file = tables(name)
    _, time, *words = name.partition("-")[0].split("_")
    plan = file.get("plan", {})
    assert file["move"]["time_s"] == TIMES_S[time]
    assert plan.get("robust", []) == (["length"] if "robust" in words else [])
    assert plan.get("input", "acceleration") == ("jerk" if "jerk" in words else "acceleration")
    shaper = words[0] if words[0] in ("zv", "zvd") else None
    assert (file["experiment"]["planner"] == shaper) is (shaper is not None)
    assert (file["move"]["distance_m"] == 0.1) is (time == "0s75")


@pytest.mark.parametrize("name", [name for name in MOVES if "-" in name])
def test_a_shorter_cable_is_the_only_difference_from_the_nominal_experiment(name: str) -> None:
    wrong, nominal = tables(name), tables(name.partition("-")[0])
    for file in (wrong, nominal):
        del file["experiment"]["name"], file["experiment"]["purpose"]
        del file["bench"]["pendulum"]["length_m"]
    assert wrong == nominal


@pytest.mark.parametrize("name", LINKS)
def test_a_load_of_several_links_runs_without_a_camera_and_its_name_tells_the_move(
    name: str,
) -> None:
    file = tables(name)
    words = name.split("_")[2:]
    planned = [tuple(link.split(":")) for link in file["model"]["links"]]
    real = [
        (f"{link['length_m']:g}", f"{link['mass_kg']:g}", link.get("kind", "point"))
        for link in file["bench"]["links"]
    ]
    assert file["camera"]["rate_hz"] == 0
    assert (planned == real) is (name not in OTHER_MODES)
    assert file["bench"]["robot"] == {"kind": "ball_screw" if "axis" in words else "quattro"}
    if words != ["free", "decay"]:
        assert file["move"]["time_s"] == TIMES_S[words[0]]
        assert file["move"]["distance_m"] == 0.2
