"""`rig identify`: what it says of a file, and what it advises."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from rig.studies.robust_choice import choose_planner

LENGTH_M, DAMPING = 0.9, 0.004
OMEGA_RAD_S = math.sqrt(9.81 / LENGTH_M)
KEYS = {
    "exit_status", "exit_code", "verdict", "reasons", "notes", "file", "kind", "unit", "samples",
    "rate_hz", "gaps", "window_s", "modes", "terms", "small_amplitude_frequency_hz",
    "cable_length_m", "sigma_cable_length_m", "damping_over_amplitude", "noise_rms",
    "residual_over_noise", "second_opinion", "budget", "plan",
}  # fmt: skip


def write_decay(path: Path, *, unit: str = "deg", seconds: float = 20.0) -> Path:
    """Write a small swing of a cable with noise as a table that a German program exports."""
    t_s = np.arange(0.0, seconds, 0.02)
    swing_rad = 0.03 * np.exp(-DAMPING * OMEGA_RAD_S * t_s) * np.cos(OMEGA_RAD_S * t_s)
    swing_rad += np.random.default_rng(1).normal(0.0, 1e-4, t_s.size)
    values = np.degrees(swing_rad) if unit == "deg" else swing_rad
    lines = ["Messung 7", f"Zeit [s];Winkel [{unit}]"]
    lines += [f"{t:.3f};{v:.6f}".replace(".", ",") for t, v in zip(t_s, values, strict=True)]
    path.write_text("\n".join(lines) + "\n", encoding="latin-1")
    return path


@pytest.fixture
def decay(tmp_path: Path) -> Path:
    return write_decay(tmp_path / "decay.csv")


def test_a_foreign_table_gives_length_and_damping_within_their_sigma(rig, decay) -> None:
    code, said, _ = rig("identify", decay, "--json")
    document = json.loads(said)
    assert (code, document["verdict"]) == (0, "good"), document["reasons"]
    assert set(document) == KEYS
    assert (document["kind"], document["unit"]) == ("pendulum", "rad")
    assert abs(document["cable_length_m"] - LENGTH_M) < 3.0 * document["sigma_cable_length_m"]
    mode = document["modes"][0]
    assert abs(mode["damping_ratio"] - DAMPING) < 3.0 * mode["sigma_damping_ratio"]
    assert abs(mode["frequency_hz"] - OMEGA_RAD_S / math.tau) < 3.0 * mode["sigma_frequency_hz"]
    squares = [row["frequency_hz"] ** 2 for row in document["budget"]]
    assert math.sqrt(sum(squares)) == pytest.approx(mode["sigma_frequency_hz"], rel=1e-6)


def test_the_terminal_says_what_was_read_and_what_to_do_next(rig, decay) -> None:
    code, said, _ = rig("identify", decay)
    flat = " ".join(said.split())
    assert code == 0
    assert "Winkel [deg]" in said
    assert "equivalent simple pendulum: 0." in flat
    assert "[model]" in said
    assert "rig plan --planner" in said
    command = flat[flat.index("rig plan") + 4 :].replace("\\ ", "").split()
    code, _, _ = rig(*command)
    assert code == 0


def test_the_figure_is_drawn(rig, decay) -> None:
    code, said, _ = rig("identify", decay, "--plot", "decay.png")
    assert code == 0
    assert "written: decay.png" in said
    assert cv2.imread("decay.png") is not None


def test_a_run_is_identified_from_its_own_log(rig) -> None:
    rig("run", "free_decay", "--virtual", "--no-report", "--set", "experiment.watch_s=8")
    code, said, _ = rig("identify", next(Path("runs").iterdir()), "--json")
    document = json.loads(said)
    assert code == 0, document["reasons"]
    assert document["unit"] == "rad"
    true_m = 0.9624
    assert abs(document["cable_length_m"] - true_m) < 3.0 * document["sigma_cable_length_m"]


def test_a_record_without_a_decay_gives_no_number(rig, tmp_path) -> None:
    t_s = np.arange(0.0, 10.0, 0.01)
    driven = np.sin(6.0 * t_s) + np.random.default_rng(2).normal(0.0, 0.003, t_s.size)
    rows = [f"{t:.3f},{v:.6f}" for t, v in zip(t_s, driven, strict=True)]
    (tmp_path / "driven.csv").write_text("\n".join(["t_s,x_m", *rows]))
    code, said, _ = rig("identify", "driven.csv", "--json")
    document = json.loads(said)
    assert (code, document["verdict"]) == (6, "refused")
    assert document["modes"] == []
    assert document["cable_length_m"] is None
    assert document["reasons"]


MISTAKES = {
    "no file": (["identify", "none.csv"], 2, "none.csv"),
    "a kind that is none": (["identify", "decay.csv", "--kind", "spring"], 2, "must be one of"),
    "five modes": (["identify", "decay.csv", "--modes", "5"], 2, "must be auto or 1 to 4"),
    "an end before the start": (
        ["identify", "decay.csv", "--from", "3", "--to", "2"], 2, "must be later",
    ),
    "a column that is not there": (["identify", "decay.csv", "--signal", "speed"], 2, "Winkel"),
    "a clock of minus one": (["identify", "decay.csv", "--clock-ppm", "-1"], 2, "must be >= 0"),
    "a unit that is none": (["identify", "decay.csv", "--unit", "furlong"], 2, "furlong"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(rig, decay, mistake: str) -> None:
    words, expected, hint = MISTAKES[mistake]
    code, _, said = rig(*words)
    assert code == expected, said
    assert hint in said.replace("\n", " ")


def test_an_exact_length_needs_no_robust_plan_and_a_vague_one_does() -> None:
    exact = choose_planner(0.98, 1e-4, 2e-4)
    vague = choose_planner(0.98, 2e-2, 2e-4)
    assert exact.chosen.candidate.robust == ()
    assert exact.chosen.worst_rad < 0.05e-3
    plain = vague.rows[0]
    assert vague.chosen.worst_rad < 0.1 * plain.worst_rad
    assert vague.lengths_m == pytest.approx((0.94, 0.96, 0.98, 1.0, 1.02))


def test_a_plan_for_a_length_leaves_no_swing_there() -> None:
    choice = choose_planner(0.5, 0.01, 0.0)
    for row in choice.rows:
        assert row.residual_rad[2] < 1e-6


def test_a_part_beside_the_record_is_refused_with_its_bounds(rig, decay) -> None:
    code, _, said = rig("identify", decay, "--from", "50")
    assert code == 2
    assert "must be within 0 to 19.98 s" in " ".join(said.split())


def test_an_unknown_unit_is_said_with_the_option(rig, tmp_path) -> None:
    t_s = np.arange(0.0, 20.0, 0.02)
    swing = 0.03 * np.exp(-0.01 * t_s) * np.cos(OMEGA_RAD_S * t_s)
    swing += np.random.default_rng(1).normal(0.0, 1e-4, t_s.size)
    (tmp_path / "one.txt").write_text("\n".join(f"{value:.6f}" for value in swing))
    _, said, _ = rig("identify", "one.txt", "--rate", "50")
    assert "give --unit" in " ".join(said.split())


def test_a_file_that_is_no_table_is_a_wrong_file(rig, tmp_path) -> None:
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(200))
    for name in ("empty.csv", "picture.png"):
        code, _, said = rig("identify", name)
        assert code == 2
        assert name in said
