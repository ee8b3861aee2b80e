"""`rig servo observer` as its users meet it, against the reference's poles and integration of the test's own."""

import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

FIGURES = tomllib.loads((Path(__file__).parent / "data" / "servo_loops.toml").read_text())
KNOWN, DRIVE = FIGURES["observer"], FIGURES["drive"]
TIMES = ",".join(str(value) for value in KNOWN["time_constant_s"])


@pytest.fixture
def told(rig):
    """The document of `rig servo observer ... --json` that ends well."""

    def call(*words):
        left, said, _ = rig("servo", "observer", *words, "--json")
        assert left == 0
        return msgspec.json.decode(said)

    return call


def test_the_elastic_pair_over_the_time_constant_is_the_reference_s(told):
    document = told("--time-constants", TIMES)
    rows = document["rows"]
    assert [row["time_constant_s"] for row in rows] == KNOWN["time_constant_s"]
    pairs = [row["rigid_nominal"]["pair"] for row in rows]
    assert [pair["frequency_rad_s"] for pair in pairs] == pytest.approx(KNOWN["elastic_rad_s"], rel=1e-6)
    assert [pair["damping"] for pair in pairs] == pytest.approx(KNOWN["elastic_damping"], rel=1e-6)
    assert document["locked_rotor"]["frequency_rad_s"] == pytest.approx(KNOWN["locked_rotor_rad_s"], rel=1e-6)
    assert document["locked_rotor"]["damping"] == pytest.approx(KNOWN["locked_rotor_damping"], rel=1e-6)
    for row in rows:
        assert row["elastic_nominal"]["pair"] == pytest.approx(document["without"]["pair"], rel=1e-9)


def test_h_f_as_printed_does_not_return_the_joint_s_own_pair(told):
    rows = told("--time-constants", TIMES)["rows"]
    assert rows[-1]["printed_h_f"]["frequency_rad_s"] == pytest.approx(KNOWN["printed_pair_rad_s"], abs=5e-3)
    assert rows[-1]["rigid_nominal"]["pair"]["frequency_rad_s"] == pytest.approx(KNOWN["elastic_rad_s"][-1], rel=1e-6)
    assert rows[0]["printed_h_f"]["frequency_rad_s"] == pytest.approx(KNOWN["locked_rotor_rad_s"], rel=1e-6)


def test_the_words_follow_the_figures(told):
    """Which time constants excite and which damp, and where the one turns into the other."""
    document = told()
    bare, turn = document["without"]["pair"]["damping"], document["break_even_s"]
    for row in document["rows"][:-1]:
        word = "damps" if row["rigid_nominal"]["pair"]["damping"] > bare else "excites"
        assert row["rigid_nominal"]["effect"] == word
        assert (row["time_constant_s"] > turn) == (word == "damps")
    assert document["rows"][-1]["rigid_nominal"]["effect"] == "leaves"
    beside = told("--time-constants", f"{turn * 0.999},{turn * 1.001},{document['best_s']},{document['best_s'] * 1.05}")["rows"]
    assert [row["rigid_nominal"]["effect"] for row in beside] == ["excites", "damps", "damps", "damps"]
    dampings = [row["rigid_nominal"]["pair"]["damping"] for row in beside]
    assert max(dampings) == dampings[2] == pytest.approx(document["best"]["damping"], rel=1e-6)


@pytest.mark.parametrize("order", [2, 3])
def test_a_filter_of_a_higher_order_has_the_same_limits_and_its_own_poles_between(told, order):
    """Butterworth: (q - 1) (plant's denominator) + (motor's numerator) (Jm s + Dm), poles at exp(j pi (2 k + n - 1) / 2 n)."""
    document = told("--order", order, "--time-constants", f"{TIMES},3e-3")
    rows = {row["time_constant_s"]: row for row in document["rows"]}
    for time_s, known in ((KNOWN["time_constant_s"][0], 0), (KNOWN["time_constant_s"][-1], -1)):
        pair = rows[time_s]["rigid_nominal"]["pair"]
        assert pair["frequency_rad_s"] == pytest.approx(KNOWN["elastic_rad_s"][known], rel=1e-6)
        assert pair["damping"] == pytest.approx(KNOWN["elastic_damping"][known], rel=1e-5)
    jm, jl = DRIVE["motor_inertia_kg_m2"], DRIVE["load_inertia_kg_m2"] / DRIVE["gear_ratio"] ** 2
    dm, k, d = DRIVE["motor_friction_n_m_s_rad"], DRIVE["stiffness_n_m_rad"], DRIVE["elastic_damping_n_m_s_rad"]
    q = {2: [1.0, 2.0**0.5, 0.0], 3: [1.0, 2.0, 2.0, 0.0]}[order] * 3e-3 ** np.arange(order, -1.0, -1.0)  # less 1
    plant = [jm * jl, (jm + jl) * d + jl * dm, (jm + jl) * k + dm * d, dm * k]
    poles = np.roots(np.polyadd(np.polymul(q, plant), np.polymul([jl, d, k], [jm, dm])))
    least = min(-p.real / abs(p) for p in poles if p.imag)
    assert rows[3e-3]["rigid_nominal"]["pair"]["damping"] == pytest.approx(least, rel=1e-6)
    assert all(row["printed_h_f"] is None for row in rows.values())


def test_with_a_nominal_of_the_whole_inertia_other_time_constants_damp(told):
    motor, whole = told(), told("--nominal-inertia", "4.2e-4")
    assert whole["nominal_inertia_kg_m2"] == 4.2e-4
    assert whole["break_even_s"] != pytest.approx(motor["break_even_s"], rel=0.01)
    assert whole["rows"][-1]["rigid_nominal"]["pair"] == pytest.approx(motor["rows"][-1]["rigid_nominal"]["pair"], rel=1e-6)


@pytest.mark.parametrize("torque", ["motor", "load"])
def test_the_load_s_answer_to_a_torque_is_that_of_an_integration_of_the_loop(told, torque):
    """Motor, load and first-order observer in the time domain: w' = (u - w) / Tf, with the estimate from w and the speed."""
    j, tf = DRIVE, 2e-3
    jm, dm, jl = j["motor_inertia_kg_m2"], j["motor_friction_n_m_s_rad"], j["load_inertia_kg_m2"] / j["gear_ratio"] ** 2
    on_motor, on_load = (1.0, 0.0) if torque == "motor" else (0.0, 1.0)

    def rate(_, x):
        """Q (u - Jm w' - Dm w) = z - (Jm / Tf) speed, with z' of the filter's state; the torque is that alone."""
        twist, speed, load_speed, z = x
        added = z - jm / tf * speed
        spring = j["stiffness_n_m_rad"] * twist + j["elastic_damping_n_m_s_rad"] * (speed - load_speed)
        motor_rate = (added + on_motor - spring - dm * speed) / jm
        return speed - load_speed, motor_rate, (spring + on_load) / jl, (added - z + (jm / tf - dm) * speed) / tf

    found = solve_ivp(rate, (0.0, 0.7), np.zeros(4), t_eval=np.linspace(0.0, 0.7, 7001), rtol=1e-9, atol=1e-12)
    row = told("--time-constants", str(tf))["rows"][0]["rigid_nominal"]
    peak = np.abs(found.y[2]).max()
    assert row[f"{torque}_step_peak_rad_s"] == pytest.approx(peak, rel=1e-4)
    rings = np.abs(np.diff(found.y[2])).sum() / (2 * peak - found.y[2, -1]) - 1.0
    assert row[f"{torque}_step_rings"] == pytest.approx(rings, abs=2e-3)


def test_a_faster_filter_rejects_more_and_lets_the_load_ring_more(told):
    rows = told()["rows"][:5]
    for nominal in ("rigid_nominal", "elastic_nominal"):
        low = [row[nominal]["low"] for row in rows]
        assert low == sorted(low)
        assert low[2] < 1e-3
    rings = [row["rigid_nominal"]["motor_step_rings"] for row in rows]
    assert rings == sorted(rings, reverse=True)
    assert rings[0] > 4.0 > 0.5 > rings[-1]
    assert all(row["stiff_load"]["damping"] == pytest.approx(1.0) for row in rows)


def test_a_stiff_load_with_a_very_fast_filter_is_the_motor_alone(told):
    row = told("--time-constants", TIMES)["rows"][0]
    assert row["stiff_load"]["frequency_rad_s"] == pytest.approx(KNOWN["motor_pole_rad_s"], rel=1e-6)


def test_the_tables_say_which_time_constants_to_be_careful_with(rig, tmp_path):
    left, said, _ = rig("servo", "observer", "--plot", tmp_path / "damping.png")
    assert left == 0
    lines = said.splitlines()
    assert any(line.startswith("0.002") and "105.433  0.2387" in line and "damps" in line for line in lines)
    assert any(line.startswith("1e+09") and "151.107" in line for line in lines)
    assert "caution: faster than T_f = 0.705 ms" in said
    assert (tmp_path / "damping.png").stat().st_size > 10_000
    assert "Fitted" in rig("servo", "observer", "--joint", "fitted")[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--joint", "normal"), "must be one of fitted, listed"),
        (("--time-constants", "soon"), "--time-constants 'soon'; must be numbers with commas, in s"),
        (("--time-constants", ","), "time_constants_s = (); must be one or more"),
        (("--time-constants", "0"), "time constant = 0.0; must be"),
        (("--time-constants", "nan"), "time constant = nan; must be"),
        (("--nominal-inertia", "-1"), "inertia_kg_m2 = -1.0; must be"),
        (("--plot", "damping"), "must end in one of"),
    ],
)
def test_what_is_no_observer_is_refused_with_the_bound(rig, words, said):
    left, out, err = rig("servo", "observer", *words)
    assert left == 2
    assert said in " ".join((out + err).split())
