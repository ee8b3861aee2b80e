"""The study of lost references: what the policies promise, and the verb."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rig.errors import ConfigError
from rig.studies.dropouts import LOSSES, MOVE_TIMES_S, DropoutRow, DropoutSpec, study
from rig.ui.cli.main import app
from rig.ui.cli.study_dropouts import dropouts

ACCELERATION_M_S2 = 5.5  # bound of the shipped experiment
Cells = dict[tuple[str, str, float], DropoutRow]

pytestmark = pytest.mark.xdist_group("dropouts")  # one worker computes what its tests share


def cells(**keys: object) -> Cells:
    """Run a study; rows by policy, planner and loss."""
    rows = study(DropoutSpec(**keys), lambda done: None)  # type: ignore[arg-type]
    return {(row.policy, row.planner, row.loss): row for row in rows}


@pytest.fixture(scope="module")
def bursts_of_five() -> Cells:
    """Every planner and policy, without loss and with 10 % in bursts of five."""
    return cells(losses=(0.0, 0.1), burst=5, seeds=2)


@pytest.mark.parametrize("planner", MOVE_TIMES_S)
def test_the_buffer_bridges_bursts_of_five(bursts_of_five: Cells, planner: str) -> None:
    without = bursts_of_five["buffer", planner, 0.0].residual_max_rad
    lossy = bursts_of_five["buffer", planner, 0.1].residual_max_rad
    assert without is not None
    assert lossy == pytest.approx(without, rel=0.1, abs=50e-6)


@pytest.mark.parametrize("planner", MOVE_TIMES_S)
def test_without_losses_buffer_and_bounded_leave_the_same(
    bursts_of_five: Cells, planner: str
) -> None:
    bounded = bursts_of_five["bounded", planner, 0.0].residual_max_rad
    assert bursts_of_five["buffer", planner, 0.0].residual_max_rad == pytest.approx(
        bounded, abs=50e-6
    )


@pytest.mark.parametrize("policy", ["bounded", "buffer"])
@pytest.mark.parametrize("planner", MOVE_TIMES_S)
def test_the_robot_keeps_its_acceleration(bursts_of_five: Cells, planner: str, policy: str) -> None:
    row = bursts_of_five[policy, planner, 0.1]
    assert row.acceleration_max_m_s2 <= 1.1 * ACCELERATION_M_S2
    assert (row.outside_max, row.finished) == (0, 2)


def test_the_policy_of_the_source_leaves_the_envelope(bursts_of_five: Cells) -> None:
    row = bursts_of_five["source", "matrix_exponential", 0.1]
    assert row.acceleration_max_m_s2 > 2 * ACCELERATION_M_S2
    assert row.outside_max > 0


def test_equal_specs_give_equal_rows() -> None:
    keys = {"planners": ("zv",), "policies": ("bounded",), "losses": (0.2,), "seeds": 2}
    assert cells(**keys) == cells(**keys)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"planners": ("zw",)}, "planner 'zw'; must be one of matrix_exponential, zv"),
        ({"policies": ("hold",)}, "policy 'hold'; must be one of source, bounded, buffer"),
        ({"losses": (1.0,)}, "loss 1; must be >= 0 and < 1"),
        ({"seeds": 0}, "seeds = 0; must be 1 to 1000"),
        ({"losses": ()}, "a list without an entry"),
    ],
)
def test_a_spec_that_cannot_be_run_is_refused(keys: dict[str, object], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        cells(**keys)


def test_the_default_study_has_every_planner_policy_and_loss() -> None:
    assert DropoutSpec().runs == len(MOVE_TIMES_S) * 3 * len(LOSSES) * 5


def test_the_verb_prints_one_document_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "dropouts.svg"
    dropouts(planners="zv", policies="bounded", losses="0,0.1", seeds=1, plot=picture, as_json=True)
    document = json.loads(capsys.readouterr().out)
    assert [row["loss"] for row in document["rows"]] == [0.0, 0.1]
    assert "bounded" in picture.read_text()


def test_losses_that_are_no_numbers_are_named() -> None:
    with pytest.raises(ConfigError, match="--losses 'many'; must be numbers"):
        dropouts(losses="many")


def test_the_group_lists_its_studies() -> None:
    assert "dropouts" in CliRunner().invoke(app, ["study", "--help"]).output
