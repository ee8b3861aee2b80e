"""The study of source 004: the rule on made-up numbers, one real comparison, and the verb."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from planners.replay.wrong_parameters import residual_curve
from rig.errors import ConfigError
from rig.run import config
from rig.run.job import plan_move
from rig.run.load_model import planner_model
from rig.studies.source_004.reasons import reason
from rig.studies.source_004.robot_step import ROBOT_STEP
from rig.studies.source_004.rule import BasisValue, RunFigures, is_holding, judge
from rig.studies.source_004.spec import SourceFinding, choose, experiments_of, source_figures
from rig.studies.source_004.study import Source004Study, study
from rig.ui.cli.study_source004 import source004

PEAK_RAD = 0.05  # 1 % of it, the width of a line, is 0.5 mrad
PUBLISHED = {  # figures of source 004 with experiments, and what we repeat on the bench beside them
    *(f"3.{k}" for k in range(26, 38)),
    *(f"4.{k}" for k in range(19, 23)),
    "tab. 4.3",
    "5.3",
}
STEP = "3.4.2"  # the one figure without a run of the experiment loop


def finding(relation: str, **keys: object) -> SourceFinding:
    """Finding on the residual swing of a against that of b."""
    if relation in ("lower", "higher", "much lower", "similar"):
        keys.setdefault("against", ("b",))
    common = {"text": "-", "runs": ("a",), "quantity": "residual_swing", "relation": relation}
    return SourceFinding(**(common | keys))  # type: ignore[arg-type]


def figures(name: str, true_mrad: float, measured_mrad: float | None = None) -> RunFigures:
    """Make up the figures of a run; the camera has 0.01 mrad of noise."""
    seen = true_mrad if measured_mrad is None else measured_mrad
    residual = {
        "true": BasisValue(value=true_mrad * 1e-3),
        "measured": BasisValue(value=seen * 1e-3, sigma=1e-5),
    }
    peak = {"true": BasisValue(value=PEAK_RAD)}
    return RunFigures(experiment=name, values={"residual_swing": residual, "peak_swing": peak})


@pytest.mark.parametrize(
    ("relation", "a_mrad", "b_mrad", "agreement"),
    [
        ("lower", 1.0, 1.1, "yes"),
        ("lower", 1.1, 1.0, "no"),
        ("lower", 1.0, 1.005, "no"),  # half a per cent is no difference
        ("lower", 0.10, 0.13, "partly"),  # 0.03 mrad: below 3 sigma of two measurements
        ("higher", 1.1, 1.0, "yes"),
        ("higher", 1.0, 1.1, "no"),
        ("much lower", 1.0, 2.0, "yes"),
        ("much lower", 1.1, 2.0, "no"),
        ("similar", 0.1, 0.5, "yes"),
        ("similar", 0.1, 0.7, "no"),
    ],
)
def test_two_runs_are_compared_by_the_stated_rule(
    relation: str, a_mrad: float, b_mrad: float, agreement: str
) -> None:
    runs = {"a": figures("a", a_mrad), "b": figures("b", b_mrad)}
    assert judge(finding(relation), runs).agreement == agreement


@pytest.mark.parametrize(
    ("relation", "keys", "a_mrad", "agreement"),
    [
        ("small", {}, 0.4, "yes"),
        ("small", {}, 0.6, "no"),
        ("above", {"bound": 1e-3}, 1.2, "yes"),
        ("above", {"bound": 1e-3}, 1.02, "partly"),  # above, but not by 3 sigma of the camera
        ("equal", {"bound": 1e-3, "last_digit": 1e-4}, 1.04, "yes"),
        ("equal", {"bound": 1e-3, "last_digit": 1e-4}, 1.07, "partly"),
        ("equal", {"bound": 1e-3, "last_digit": 1e-4}, 1.2, "no"),
    ],
)
def test_a_run_is_compared_with_a_number_by_the_stated_rule(
    relation: str, keys: dict[str, float], a_mrad: float, agreement: str
) -> None:
    assert judge(finding(relation, **keys), {"a": figures("a", a_mrad)}).agreement == agreement


def test_a_finding_that_the_camera_contradicts_agrees_partly_and_names_the_check() -> None:
    runs = {"a": figures("a", 1.0, measured_mrad=1.2), "b": figures("b", 1.1)}
    result = judge(finding("lower"), runs)
    assert result.agreement == "partly"
    assert reason(finding("lower"), result) == "Not lower: a against b (measured)."


def test_every_run_is_compared_with_every_other_one() -> None:
    claim = finding("lower", runs=("a", "b"), against=("c", "d"))
    runs = {name: figures(name, mrad) for name, mrad in zip("abcd", (1, 2, 3, 1.5), strict=True)}
    result = judge(claim, runs)
    assert result.agreement == "partly"
    assert {(check.run, check.against) for check in result.failed} == {("b", "d")}


def test_many_failed_comparisons_are_counted_and_the_note_follows() -> None:
    claim = finding("lower", against=("b", "c", "d"), note="Why so.")
    runs = {name: figures(name, mrad) for name, mrad in zip("abcd", (2, 1, 1, 3), strict=True)}
    assert reason(claim, judge(claim, runs)) == "2 of 6 comparisons hold. Why so."
    assert reason(claim, judge(claim, runs | {"a": figures("a", 0.5)})) == ""


def test_a_value_that_is_not_identifiable_satisfies_no_relation() -> None:
    missing, known = BasisValue(value=None), BasisValue(value=1.0)
    hidden = BasisValue(value=None, sigma=0.1)  # 0 within its sigma
    assert is_holding(finding("small"), hidden, None, 1.0)
    assert is_holding(finding("lower"), hidden, known, 1.0)
    assert not is_holding(finding("lower"), known, hidden, 1.0)
    for relation in ("lower", "higher", "much lower", "similar"):
        assert not is_holding(finding(relation), missing, known, 1.0)
        assert not is_holding(finding(relation), known, missing, 1.0)
    assert not is_holding(finding("small"), missing, None, 1.0)
    assert not is_holding(finding("equal", bound=1.0), missing, None, 1.0)


@pytest.mark.parametrize(
    ("relation", "keys"),
    [("lower", {"against": ()}), ("small", {"against": ("b",)}), ("above", {}), ("equal", {})],
)
def test_a_relation_without_what_it_compares_is_refused(
    relation: str, keys: dict[str, object]
) -> None:
    with pytest.raises(ValueError, match="relation"):
        finding(relation, **keys)


def test_a_run_without_a_camera_is_compared_by_the_truth_alone() -> None:
    seen, unseen = figures("a", 1.0), figures("b", 1.1)
    del unseen.values["residual_swing"]["measured"]
    for runs in ({"a": seen, "b": unseen}, {"a": unseen, "b": seen}):
        checks = judge(finding("similar"), runs).checks
        assert [check.basis for check in checks] == ["true"]


def test_a_swing_below_what_the_camera_can_tell_is_compared_by_the_truth_alone() -> None:
    seen, faint = figures("a", 1.0), figures("b", 1.1)
    faint.values["residual_swing"]["measured"] = BasisValue(value=None)
    result = judge(finding("similar"), {"a": seen, "b": faint})
    assert [(check.basis, check.holds) for check in result.checks] == [("true", True)]
    faint.values["residual_swing"]["true"] = BasisValue(value=None)
    assert judge(finding("similar"), {"a": seen, "b": faint}).agreement == "no"


def test_a_quantity_without_any_value_is_no_agreement_but_an_error() -> None:
    unseen = figures("a", 1.0)
    unseen.values["residual_swing"].clear()
    with pytest.raises(ValueError, match="residual_swing of a: no value"):
        judge(finding("small"), {"a": unseen})


def test_every_figure_and_every_experiment_of_the_source_is_in_the_study() -> None:
    numbers = {figure.number for figure in source_figures()}
    names = {name for name in config.shipped() if name.startswith("source004_")}
    assert numbers >= PUBLISHED
    used = {name.partition(":")[0] for name in experiments_of(source_figures())}
    assert used == names | {ROBOT_STEP}
    assert all(figure.findings for figure in source_figures())


def test_figures_are_chosen_by_number_or_by_an_experiment() -> None:
    assert [f.number for f in choose(["3.34", "tab. 4.3"])] == ["3.34", "tab. 4.3"]
    assert [f.number for f in choose(["source004_0s75_jerk"])] == ["3.31", "3.32"]
    assert [f.number for f in choose(["source004_1s1_holes"])] == ["3.30"]
    with pytest.raises(ConfigError, match=r"'3\.99' is neither a figure nor an experiment"):
        choose(["3.99"])


@pytest.fixture(scope="module")
def figure_3_34() -> Source004Study:
    """Plain and robust plan on a cable that is 18 cm shorter than the model."""
    return study(choose(["3.34"]), lambda done: None)


def test_the_runs_of_a_comparison_leave_what_the_plans_leave_on_a_nonlinear_cable(
    figure_3_34: Source004Study,
) -> None:
    for name, run in figure_3_34.runs.items():
        chosen = config.read_experiment(name, [])
        plan = plan_move(chosen)
        assert plan is not None
        (expected,) = residual_curve(
            planner_model(chosen), plan.motion.x, "length", [0.7824], nonlinear=True
        )
        residual = run.values["residual_swing"]
        assert residual["true"].value == pytest.approx(expected, rel=0.01)
        assert residual["measured"].value == pytest.approx(expected, rel=0.02)


def test_a_real_comparison_agrees_and_carries_its_curves(figure_3_34: Source004Study) -> None:
    (row,) = figure_3_34.figures
    assert [result.agreement for result in row.results] == ["yes"]
    for name, curves in figure_3_34.curves.items():
        peak_rad = figure_3_34.runs[name].values["peak_swing"]["true"].value
        assert peak_rad is not None
        assert max(abs(curves.swing_rad)) == pytest.approx(peak_rad, rel=0.01)
        assert curves.position_m[-1] == pytest.approx(0.2, abs=1e-4)


def residuals_mrad(name: str, length_m: float, changes: list[str]) -> tuple[float, float]:
    """Residual swing of a plan on the small-swing and on the nonlinear cable [mrad]."""
    chosen = config.read_experiment(name, changes)
    plan = plan_move(chosen)
    assert plan is not None
    model = planner_model(chosen)
    linear, nonlinear = (
        float(residual_curve(model, plan.motion.x, "length", [length_m], nonlinear=n)[0]) * 1e3
        for n in (False, True)
    )
    return linear, nonlinear


def test_the_numbers_in_the_notes_are_those_of_the_plans() -> None:
    notes = {f.number: " ".join(x.note for x in f.findings) for f in source_figures()}
    robust = residuals_mrad("source004_2s5_robust", 0.9024, [])
    shaped = residuals_mrad("source004_2s5_zvd", 0.9024, [])
    for value in (*robust, *shaped):
        assert f"{value:.3f}" in notes["3.37"]
    assert robust[0] < shaped[0]
    assert robust[1] > shaped[1]
    assert f"{math.sqrt(9.81 / 0.9624):.4f} rad/s" in notes["3.26"]


def test_the_verb_prints_one_document_and_writes_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert source004(only=f"3.34,{STEP}", page=page, as_json=True) == 0
    document = json.loads(capsys.readouterr().out)
    first, second = document["figures"]
    assert first["findings"][0]["agreement"] == "yes"
    assert [one["agreement"] for one in second["findings"]] == ["yes", "yes"]
    assert len(document["runs"]) == 3
    assert document["runs_without_camera"] == []
    text = page.read_text()
    assert text.count("<svg") == 1
    assert "http" not in text.replace("http-equiv", "")


def test_the_tables_fit_eighty_columns(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    source004(only=STEP)
    said = capsys.readouterr()
    assert "31.5 ms; printed 31 ms" in said.out
    assert max(map(len, said.out.splitlines())) <= 80


def test_a_page_in_a_folder_that_does_not_exist_is_refused_before_any_run(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no folder"):
        source004(only=STEP, page=tmp_path / "none" / "page.html")
