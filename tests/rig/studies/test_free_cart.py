"""Comparison of the free cart: bench, linear model, and the verb that prints them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig.studies.thesis_tables import free_cart
from rig.studies.thesis_tables.bench import CartMotion, ForceStep, nonlinear_motion
from rig.studies.thesis_tables.free_cart import (
    BARS,
    PRINTED_MASS_KG,
    START_RAD,
    FreeCartCase,
    equivalent_mass_kg,
    expected_relations,
    free_cart_cases,
    linear_motion,
    load_model,
    slow_frequency_hz,
)


@pytest.fixture(scope="module")
def cases() -> tuple[FreeCartCase, FreeCartCase]:
    return free_cart_cases()


def test_the_parts_of_the_drive_add_up_to_nine_kilograms_more_than_printed() -> None:
    assert equivalent_mass_kg() == pytest.approx(19.5223, abs=5e-5)
    assert equivalent_mass_kg() - PRINTED_MASS_KG == pytest.approx(9.0, abs=1e-4)


def test_the_linear_motion_is_that_of_an_integrator() -> None:
    model = load_model(PRINTED_MASS_KG)
    space = model.state_space("force")
    motion = linear_motion(model)
    state = np.array([0.0, 0.0, START_RAD, START_RAD, 0.0, 0.0])
    t_s = 0.0
    for duration_s, force_n in ((2.0, 2.0), (2.0, -2.0), (6.0, 0.0)):
        pull = space.b[:, 0] * force_n
        end_s = t_s + duration_s
        found = solve_ivp(
            lambda _, x, pull=pull: space.a @ x + pull,
            (t_s, end_s),
            state,
            method="DOP853",
            rtol=1e-10,
            atol=1e-12,
        )
        state, t_s = found.y[:, -1], end_s
        k = round(end_s / 0.01)
        ours = [motion.position_m[k], *motion.angles_rad[k], *motion.rates_rad_s[k]]
        assert ours == pytest.approx([state[0], *state[2:]], abs=1e-7)


def test_the_centre_of_mass_ends_where_the_impulses_bring_it(
    cases: tuple[FreeCartCase, FreeCartCase],
) -> None:
    """8 N s^2 over the total mass, whatever the load does; sin becomes its argument."""
    for case in cases:
        equations = load_model(case.cart_mass_kg).equations
        total_kg = case.cart_mass_kg + sum(bar.mass_kg for bar in BARS)
        shares_m = equations.coupling_kg_m / total_kg
        for motion, offset in ((case.bench, np.sin), (case.linear, np.positive)):
            centre_m = motion.position_m + offset(motion.angles_rad) @ shares_m
            assert centre_m[-1] - centre_m[0] == pytest.approx(8.0 / total_kg, abs=1e-9)


def test_a_fit_finds_the_frequency_of_a_linear_mode(
    cases: tuple[FreeCartCase, FreeCartCase],
) -> None:
    for case in cases:
        assert case.linear_figures.frequency_hz == pytest.approx(case.free_modes_hz[0], rel=1e-7)


def test_a_fit_agrees_with_the_zero_crossings_of_the_angle(
    cases: tuple[FreeCartCase, FreeCartCase],
) -> None:
    for case in cases:
        crossings_hz = _zero_crossing_frequency_hz(case.bench)
        assert case.bench_figures.frequency_hz == pytest.approx(crossings_hz, rel=1e-3)


def _zero_crossing_frequency_hz(motion: CartMotion) -> float:
    """Frequency of theta1 after 4 s by its first and last zero crossing."""
    angle_rad = motion.angles_rad[400:, 0]
    before = np.flatnonzero(np.diff(np.sign(angle_rad)))
    shares = angle_rad[before] / (angle_rad[before] - angle_rad[before + 1])
    crossings_s = 0.01 * (before + shares)
    return float(0.5 * (len(crossings_s) - 1) / (crossings_s[-1] - crossings_s[0]))


def test_the_bench_is_slower_at_a_large_amplitude_alone(
    cases: tuple[FreeCartCase, FreeCartCase],
) -> None:
    printed, right = cases
    for case in cases:
        assert abs(case.small_change_rel) < 1e-4
        assert -0.03 < case.frequency_change_rel < -0.02
    assert right.free_modes_hz[0] == pytest.approx(1.0758, abs=5e-5)
    assert right.driven_modes_hz == pytest.approx((1.03142, 11.0227), rel=1e-4)
    assert printed.free_modes_hz[0] == pytest.approx(1.1104, abs=5e-5)


def test_every_relation_is_the_expected_one(cases: tuple[FreeCartCase, FreeCartCase]) -> None:
    relations = expected_relations(cases)
    assert len(relations) == 7
    assert [relation.name for relation in relations if not relation.holds] == []


def test_the_bench_follows_the_linear_model_at_a_hundredth_of_a_degree() -> None:
    model = load_model(PRINTED_MASS_KG)
    share = 1e-4
    forces = (ForceStep(2.0, 2.0 * share), ForceStep(1.0, -2.0 * share))
    bench = nonlinear_motion(model, share * START_RAD, forces, 0.01)
    linear = linear_motion(model)
    np.testing.assert_allclose(bench.position_m / share, linear.position_m[:301], atol=1e-6)
    np.testing.assert_allclose(bench.angles_rad / share, linear.angles_rad[:301], atol=1e-5)
    assert slow_frequency_hz(model, linear, 4.0) == pytest.approx(1.1104, abs=5e-5)


def test_the_verb_prints_a_table_and_writes_its_files(rig, monkeypatch) -> None:
    code, said, _ = rig("compare", "free_cart", "--plot", "cart.svg", "--csv", "cart.csv")
    assert code == 0
    assert "free-cart mode 1 [Hz]" in said
    assert max(map(len, said.splitlines())) <= 160
    assert "<svg" in Path("cart.svg").read_text()
    with Path("cart.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4 * 1001
    assert {row["motion"] for row in rows} == {"bench", "linear"}

    code, said, _ = rig("compare", "free_cart", "--json")
    document = json.loads(said)
    assert (code, document["exit_status"]) == (0, "ok")
    assert [case["cart_mass_kg"] for case in document["cases"]] == pytest.approx([10.5223, 19.5223])
    assert all(relation["holds"] for relation in document["relations"])

    monkeypatch.setattr(free_cart, "FREQUENCY_CHANGE_REL", (0.01, 0.04))
    code, said, _ = rig("compare", "free_cart", "--json")
    assert (code, json.loads(said)["exit_status"]) == (6, "bad_data")


def test_a_figure_file_of_an_unknown_kind_is_refused_before_the_simulation(rig) -> None:
    code, _, why = rig("compare", "free_cart", "--plot", "cart.doc")
    assert code == 2
    assert "must end in one of" in why
