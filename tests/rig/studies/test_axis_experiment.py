"""From `rig size` to `rig run`: the experiment of a sized axis."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from rig.analysis.analyze import RunAnalysis
from rig.errors import ConfigError
from rig.run import config, experiment
from rig.run.runs import LOG
from rig.run.runtime import bench
from rig.studies.sizing.axis_experiment import experiment_text
from rig.studies.sizing.axis_file import example_tables, sizing_of
from rig.studies.sizing.judgement import judge
from rig.ui.cli.size import size

BRIEF = ["camera.rate_hz=0", "experiment.quiet_s=0.3", "experiment.watch_s=0.5"]


def written(tmp_path: Path, **changes: object) -> Path:
    """Experiment of the appendix' axis, with changed keys of [axis]."""
    tables = example_tables("appendix")
    tables["axis"] |= changes
    path = tmp_path / "sized.toml"
    path.write_text(experiment_text(judge(sizing_of(tables))))
    return path


def test_the_plant_has_the_figures_of_the_sizing(tmp_path: Path) -> None:
    plant = bench.params(config.read_experiment(str(written(tmp_path)), []))
    assert plant.axis is not None
    screw_kg = 7800.0 * math.pi * 0.02**2 / 4.0 * 0.8
    inertia = screw_kg * 0.02**2 / 8.0 + 2.16e-5 + 3.0e-5
    assert plant.axis.rotary_inertia_kg_m2 == pytest.approx(inertia, rel=1e-5)
    assert plant.axis.screw_axial_mass_kg == pytest.approx(screw_kg / 3.0, rel=1e-5)
    assert (plant.axis.lead_m, plant.axis.table_mass_kg, plant.axis.efficiency) == (0.02, 10, 0.95)
    assert plant.axis.coulomb_force_n == pytest.approx(9.66096, rel=1e-5)
    assert plant.axis.torque_limit_n_m == 3.8
    assert (plant.axis.negative_stop_m, plant.axis.positive_stop_m) == (-0.4, 0.4)


def test_the_load_is_moved_on_the_sized_axis(tmp_path: Path) -> None:
    loaded = config.read_experiment(str(written(tmp_path)), BRIEF)
    ran = experiment.run(loaded, "virtual", tmp_path, lambda *_: None, lambda *_: None)
    summary = RunAnalysis(ran.folder / LOG).summary
    assert (ran.outcome.exit_code, summary.verdict) == (0, "good")
    assert summary.truth is not None
    assert summary.truth.residual_swing_rad == pytest.approx(
        summary.planned.residual_swing_rad, abs=0.1e-3
    )


def test_a_slope_is_left_out_and_that_is_said(tmp_path: Path) -> None:
    assert "slope of 10 degrees is left out" in written(tmp_path).read_text()
    assert "slope" not in written(tmp_path, slope_deg=0.0).read_text()


def test_a_constant_force_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="force_n = 50; must be 0 for --experiment"):
        written(tmp_path, force_n=50.0)


def test_the_verb_names_the_file_and_refuses_a_folder_that_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "axis.toml"
    size(example="appendix", experiment=path)
    assert f"written: {path}" in capsys.readouterr().out
    assert config.read_experiment(str(path), []).experiment.name == "sized_axis"
    with pytest.raises(ConfigError, match="no folder"):
        size(example="appendix", experiment=tmp_path / "none" / "axis.toml")
