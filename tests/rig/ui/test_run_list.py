"""`rig run --list`: every shipped experiment in a row, and nothing is run."""

import json
from pathlib import Path

from rig.run import config


def test_every_experiment_is_listed_with_its_purpose_and_nothing_runs(rig):
    code, said, told = rig("run", "--list")
    assert (code, told) == (0, "")
    first_words = {line.split()[0] for line in said.splitlines() if line.strip()}
    assert set(config.shipped()) <= first_words
    assert "20 % of the references lost, ten at a time" in said
    assert not Path("runs").exists()


def test_the_list_fits_eighty_columns_without_a_cut_name(rig, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    _, said, _ = rig("run", "--list")
    lines = said.splitlines()
    assert max(map(len, lines)) <= 80
    assert "…" not in said
    assert {name for name in config.shipped() if any(line.startswith(name) for line in lines)} == (
        set(config.shipped())
    )


def test_the_list_is_one_document(rig):
    code, said, _ = rig("run", "--list", "--json")
    document = json.loads(said)
    rows = {row["name"]: row for row in document["experiments"]}
    assert (code, document["exit_status"]) == (0, "ok")
    assert list(rows) == config.shipped()
    assert rows["source004_2s_robust-18cm"]["planner"] == "finite_differences"
    assert rows["joint_1"]["load_angle_deg"] == 40.0
