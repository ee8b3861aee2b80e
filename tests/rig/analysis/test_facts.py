"""Logs of other builds open: the analysis reads the keys it needs and ignores all others."""

import json
import math
from pathlib import Path

import msgspec
import pytest

from comms.errors import LogError
from rig.analysis.analyze import RunAnalysis
from rig.analysis.facts import ControllerFacts, read_facts

OLD_LOG = Path(__file__).parents[2] / "data" / "logs" / "e295f92_move_virtual.mcap"
# what the build that wrote the log said of it
OLD_MEASURED = {
    "peak_swing_rad": 0.07242441563453297,
    "residual_swing_rad": 0.002637806838867889,
    "natural_frequency_hz": 0.503551467164394,
    "damping_ratio": 0.00023454033207153215,
    "cable_length_m": 0.9799897635386241,
}
TABLES = {
    "camera": {"rate_hz": 50.0},
    "vision": {"average_frames": 3},
    "model": {"length_m": 0.9, "gravity_m_s2": 9.81},
    "links": {"reference": {"delay_ms": 1.0, "jitter_ms": 2.5}},
}


def facts_of(tables):
    """Facts of an experiment.json with these tables."""
    return read_facts(json.dumps(tables).encode(), Path("run.mcap"))


def test_a_log_of_build_e295f92_gives_the_figures_that_build_gave():
    summary = RunAnalysis(OLD_LOG).summary
    for name in ("natural_frequency_hz", "damping_ratio", "cable_length_m"):
        assert getattr(summary.measured, name) == pytest.approx(OLD_MEASURED[name], rel=1e-6)
    assert summary.verdict == "good"
    assert summary.links["setpoint"].sent == 1799
    assert all(link.unexplained == 0 for link in summary.links.values())


def test_the_perspective_in_an_old_log_is_removed_by_the_table_of_its_camera():
    summary = RunAnalysis(OLD_LOG).summary
    for name in ("peak_swing_rad", "residual_swing_rad"):
        measured, true = getattr(summary.measured, name), getattr(summary.truth, name)
        assert abs(OLD_MEASURED[name] - true) > 10.0 * getattr(summary.sigma_noise, name)
        assert abs(measured - true) < 3.0 * getattr(summary.sigma, name)
        assert measured / OLD_MEASURED[name] == pytest.approx(1.0052, abs=5e-5)


def test_the_facts_are_taken_from_their_tables():
    facts = facts_of(TABLES)
    assert (facts.rate_hz, facts.average_frames, facts.gravity_m_s2) == (50.0, 3, 9.81)
    assert (facts.cable_length_m, facts.reference_delay_ms) == (0.9, 3.5)


def test_the_model_is_a_cable_with_its_damping_or_a_chain():
    damped = {**TABLES, "model": {**TABLES["model"], "damping_ratio": 0.01}}
    chain = {**TABLES, "model": {**TABLES["model"], "links": ["0.5:1:bar"]}}
    assert (facts_of(damped).damping_ratio, facts_of(damped).is_chain) == (0.01, False)
    assert (facts_of(TABLES).damping_ratio, facts_of(chain).is_chain) == (0.0, True)


def test_keys_that_the_analysis_does_not_use_are_ignored():
    more = {**TABLES, "brakes": {"kind": "disc"}, "model": {**TABLES["model"], "colour": "red"}}
    assert facts_of(more) == facts_of(TABLES)


def test_optional_facts_have_their_defaults():
    facts = facts_of({**TABLES, "links": {}, "model": {"gravity_m_s2": 9.81, "length_m": None}})
    assert (facts.cable_length_m, facts.reference_delay_ms) == (1.0, 0.0)


@pytest.mark.parametrize(
    ("table", "key"),
    [("camera", "rate_hz"), ("vision", "average_frames"), ("model", "gravity_m_s2")],
)
@pytest.mark.parametrize("value", [None, "fifty", True])
def test_a_log_that_lacks_a_fact_says_which(table, key, value):
    tables = {**TABLES, table: {**TABLES[table], key: value}}
    with pytest.raises(
        LogError, match=rf"run\.mcap: experiment\.json has no number {table}\.{key}"
    ):
        facts_of(tables)
    without = {name: keys for name, keys in TABLES.items() if name != table}
    with pytest.raises(LogError, match=rf"no number {table}\.{key}"):
        facts_of(without)


def test_only_the_policy_buffer_delays_the_setpoints() -> None:
    settings = b'{"policy": "%s", "playout_ns": 120000000}'
    delays = {
        policy: msgspec.json.decode(settings % policy, type=ControllerFacts).delay_s
        for policy in (b"buffer", b"bounded", b"source")
    }
    assert delays == pytest.approx({b"buffer": 0.12, b"bounded": 0.0, b"source": 0.0})


def test_a_log_without_settings_of_the_controller_has_no_bounds() -> None:
    facts = msgspec.json.decode(b"{}", type=ControllerFacts)
    assert facts.delay_s == 0.0
    assert facts.envelope.speed_m_s == math.inf
