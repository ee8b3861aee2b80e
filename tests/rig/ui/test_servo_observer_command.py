"""`rig servo observer` against reference poles and an independent integration."""

import tomllib
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.integrate import solve_ivp

FIGURES = tomllib.loads((Path(__file__).parents[2] / "data" / "servo_loops.toml").read_text())
KNOWN, DRIVE = FIGURES["observer"], FIGURES["drive"]
TIMES = ",".join(str(value) for value in KNOWN["time_constant_s"])


@pytest.fixture
def told(rig):
    """JSON document of `rig servo observer`, which must end with exit code 0."""

    def call(*words):
        left, said, _ = rig("servo", "observer", *words, "--json")
        assert left == 0
        return msgspec.json.decode(said)

    return call


def test_the_elastic_pair_over_the_time_constant_is_the_reference_s(told):
    document = told("--time-constants", TIMES)
    rows = document["rows"]
    assert [row["time_constant_s"] for row in rows] == KNOWN["time_constant_s"]
    pairs = [row["rigid_nominal"]["least_damped"] for row in rows]
    assert [pair["frequency_rad_s"] for pair in pairs] == pytest.approx(
        KNOWN["elastic_rad_s"], rel=1e-6
    )
    assert [pair["damping"] for pair in pairs] == pytest.approx(KNOWN["elastic_damping"], rel=1e-6)
    assert document["locked_rotor"]["frequency_rad_s"] == pytest.approx(
        KNOWN["locked_rotor_rad_s"], rel=1e-6
    )
    assert document["locked_rotor"]["damping"] == pytest.approx(
        KNOWN["locked_rotor_damping"], rel=1e-6
    )
    for row in rows:
        assert row["elastic_nominal"]["least_damped"] == pytest.approx(
            document["without"]["least_damped"], rel=1e-9
        )


def test_h_f_as_printed_does_not_return_the_joint_s_own_pair(told):
    rows = told("--time-constants", TIMES)["rows"]
    assert rows[-1]["printed_h_f"]["frequency_rad_s"] == pytest.approx(
        KNOWN["printed_pair_rad_s"], abs=5e-3
    )
    assert rows[-1]["rigid_nominal"]["least_damped"]["frequency_rad_s"] == pytest.approx(
        KNOWN["elastic_rad_s"][-1], rel=1e-6
    )
    assert rows[0]["printed_h_f"]["frequency_rad_s"] == pytest.approx(
        KNOWN["locked_rotor_rad_s"], rel=1e-6
    )


def test_the_effect_follows_from_the_damping_ratio(told):
    """Time constants that excite, time constants that damp, and the boundary between them."""
    document = told()
    bare, ((start, turn),) = document["without"]["least_damped"]["damping"], document["excited_s"]
    assert start == 0.0
    for row in document["rows"][:-1]:
        word = "damps" if row["rigid_nominal"]["least_damped"]["damping"] > bare else "excites"
        assert row["rigid_nominal"]["effect"] == word
        assert (row["time_constant_s"] > turn) == (word == "damps")
    assert document["rows"][-1]["rigid_nominal"]["effect"] == "leaves"
    beside = told(
        "--time-constants",
        f"{turn * 0.999},{turn * 1.01},{document['best_s']},{document['best_s'] * 1.05}",
    )["rows"]
    assert [row["rigid_nominal"]["effect"] for row in beside] == [
        "excites",
        "damps",
        "damps",
        "damps",
    ]
    dampings = [row["rigid_nominal"]["least_damped"]["damping"] for row in beside]
    assert max(dampings) == dampings[2] == pytest.approx(document["best"]["damping"], rel=1e-6)


def least_damping(order, time_s, drive=DRIVE):
    """Least damping ratio of the poles with a Butterworth filter Q of an order.

    Characteristic polynomial: (q - 1) (plant denominator) + (motor numerator) (Jm s + Dm);
    poles of Q at exp(j pi (2 k + n - 1) / 2 n) / time_s.
    """
    poles_of_q = (
        np.exp(0.5j * np.pi * (2.0 * np.arange(1, order + 1) + order - 1.0) / order) / time_s
    )
    q = np.poly(poles_of_q).real * time_s**order
    q[-1] = 0.0
    jm, jl = drive["motor_inertia_kg_m2"], drive["load_inertia_kg_m2"] / drive["gear_ratio"] ** 2
    dm, k, d = (
        drive["motor_friction_n_m_s_rad"],
        drive["stiffness_n_m_rad"],
        drive["elastic_damping_n_m_s_rad"],
    )
    plant = [jm * jl, (jm + jl) * d + jl * dm, (jm + jl) * k + dm * d, dm * k]
    poles = np.roots(np.polyadd(np.polymul(q, plant), np.polymul([jl, d, k], [jm, dm])))
    return min(-p.real / abs(p) for p in poles)


@pytest.mark.parametrize("order", range(1, 9))
def test_the_reported_intervals_hold_all_exciting_and_unstable_time_constants(told, order):
    document = told("--order", order)
    bare = document["without"]["least_damped"]["damping"]
    for told_s, level in ((document["excited_s"], 0.999 * bare), (document["unstable_s"], 0.0)):
        intervals = [(low, np.inf if high is None else high) for low, high in told_s]
        for time_s in np.geomspace(2e-6, 50.0, 250):
            inside = any(low < time_s < high for low, high in intervals)
            assert inside == (least_damping(order, time_s) < level), time_s
        ends = [end for interval in intervals for end in interval if 0.0 < end < np.inf]
        assert [least_damping(order, end) for end in ends] == pytest.approx(
            [level] * len(ends), abs=1e-7
        )
    assert bool(document["unstable_s"]) == (order >= 5)


def test_an_unstable_observer_is_named_and_has_no_figures(told, rig):
    words = ("--order", "8", "--time-constants", "5e-4,5e-3")
    document = told(*words)
    calm, wild = document["rows"]
    assert least_damping(8, 5e-3) < 0.0 < least_damping(8, 5e-4)
    assert calm["rigid_nominal"]["stable"]
    assert not wild["rigid_nominal"]["stable"]
    assert wild["rigid_nominal"]["effect"] == "unstable"
    figures = (
        "low",
        "peak_rad_s_n_m",
        "motor_step_peak_rad_s",
        "motor_step_rings",
        "load_step_peak_rad_s",
        "load_step_rings",
    )
    assert [wild["rigid_nominal"][figure] for figure in figures] == [None] * 6
    assert None not in [calm["rigid_nominal"][figure] for figure in figures]
    assert wild["elastic_nominal"]["stable"]
    said = rig("servo", "observer", *words)[1]
    lines = said.splitlines()
    assert any(line.startswith("5 ") and "-0.0773" in line and "unstable" in line for line in lines)
    assert any(
        line.startswith("5 ") and line.split()[1:] == ["rigid", "unstable", *"-----", "0.02773"]
        for line in lines
    )
    assert "caution: unstable at T_f 3.03 to 7.5 ms" in said


def test_an_observer_unstable_with_a_stiff_load_is_reported(told):
    """Nominal inertia of ten times the total one, with Q of order 4."""
    row = told("--order", "4", "--nominal-inertia", "4.2e-3", "--time-constants", "5e-3")["rows"][
        0
    ]["stiff_load"]
    assert row["damping"] < 0.0
    assert not row["stable"]
    assert row["low"] is None


@pytest.mark.parametrize("inertia", ["4.2e-3", "1"])
def test_an_unstable_observer_is_drawn_without_its_responses(rig, tmp_path, inertia):
    left, said, _ = rig(
        "servo",
        "observer",
        "--order",
        "8",
        "--nominal-inertia",
        inertia,
        "--plot",
        tmp_path / "wild.svg",
    )
    assert left == 0
    assert "caution: unstable at T_f" in said
    assert (tmp_path / "wild.svg").stat().st_size > 10_000


def test_a_pole_of_q_may_be_the_least_damped_one(told, rig):
    row = told("--order", "8", "--time-constants", "5e-4")["rows"][0]["rigid_nominal"]
    assert row["least_damped"]["frequency_rad_s"] == pytest.approx(1.0 / 5e-4, rel=0.01)
    assert row["least_damped"]["damping"] == pytest.approx(least_damping(8, 5e-4), rel=1e-6)
    assert "those of Q included" in rig("servo", "observer")[1]


@pytest.fixture
def own(tmp_path):
    """Function that writes a comparison file with changed constants of the model."""

    def write(**changes):
        move = {"load_angle_deg": 40.0, "time_s": 0.5, "motor_acceleration_rad_s2": 1200.0}
        tables = {"[[move]]": move, "[bench]": DRIVE, "[model]": DRIVE | changes}
        path = tmp_path / "mine.toml"
        path.write_text(
            "\n".join(
                "\n".join((head, *(f"{k} = {v}" for k, v in table.items())))
                for head, table in tables.items()
            )
        )
        return path

    return write


def test_the_joint_of_a_comparison_file_is_its_model(told, own):
    same = told("--joint", own())
    assert same["rows"] == told()["rows"]
    assert same["inferred"] is None
    drive = DRIVE | {"stiffness_n_m_rad": 12.0}
    row = told("--joint", own(stiffness_n_m_rad=12.0), "--time-constants", "1e-3")["rows"][0]
    assert row["rigid_nominal"]["least_damped"]["damping"] == pytest.approx(
        least_damping(1, 1e-3, drive), rel=1e-6
    )


def test_a_joint_without_friction_answers_a_torque_as_its_equations_do(told, own):
    """Without observer the speed grows, with one it returns to rest.

    State of the first-order filter: z = Q (u - Jm w') + (Jm / Tf) w.
    """
    document = told("--joint", own(motor_friction_n_m_s_rad=0.0), "--time-constants", "2e-3")
    jm, jl = DRIVE["motor_inertia_kg_m2"], DRIVE["load_inertia_kg_m2"] / DRIVE["gear_ratio"] ** 2
    k, d, tf = DRIVE["stiffness_n_m_rad"], DRIVE["elastic_damping_n_m_s_rad"], 2e-3

    def rate(_, x, observed):
        twist, speed, load_speed, z = x
        added = observed * (z - jm / tf * speed)
        spring = k * twist + d * (speed - load_speed)
        return (
            speed - load_speed,
            (added + 1.0 - spring) / jm,
            spring / jl,
            (added - z + jm / tf * speed) / tf,
        )

    watched = 12 * 2 * np.pi / np.sqrt(k / jl)
    for observed, row in ((0.0, document["without"]), (1.0, document["rows"][0]["rigid_nominal"])):
        times = np.linspace(0.0, watched, 6001)
        found = solve_ivp(
            rate, (0.0, watched), np.zeros(4), t_eval=times, args=(observed,), rtol=1e-9, atol=1e-12
        )
        assert row["motor_step_peak_rad_s"] == pytest.approx(np.abs(found.y[2]).max(), rel=1e-5)


def test_poles_of_q_do_not_count_against_a_better_damped_joint(told, own):
    """The slow limit leaves the joint unchanged, with Q's poles at a damping ratio of 0.195."""
    document = told(
        "--joint", own(elastic_damping_n_m_s_rad=0.01), "--order", "8", "--time-constants", "1e9"
    )
    assert document["without"]["least_damped"]["damping"] > 0.3
    assert document["rows"][0]["rigid_nominal"]["least_damped"]["damping"] == pytest.approx(
        np.sin(np.pi / 16.0)
    )
    assert document["rows"][0]["rigid_nominal"]["effect"] == "leaves"
    assert all(high is not None for _, high in document["excited_s"])


@pytest.mark.parametrize("order", [2, 3])
def test_a_filter_of_a_higher_order_has_the_same_limits_and_its_own_poles_between(told, order):
    document = told("--order", order, "--time-constants", f"{TIMES},3e-3")
    rows = {row["time_constant_s"]: row for row in document["rows"]}
    for time_s, known in ((KNOWN["time_constant_s"][0], 0), (KNOWN["time_constant_s"][-1], -1)):
        pair = rows[time_s]["rigid_nominal"]["least_damped"]
        assert pair["frequency_rad_s"] == pytest.approx(KNOWN["elastic_rad_s"][known], rel=1e-6)
        assert pair["damping"] == pytest.approx(KNOWN["elastic_damping"][known], rel=1e-5)
    assert rows[3e-3]["rigid_nominal"]["least_damped"]["damping"] == pytest.approx(
        least_damping(order, 3e-3), rel=1e-6
    )
    assert all(row["printed_h_f"] is None for row in rows.values())


def test_with_a_nominal_of_the_whole_inertia_other_time_constants_damp(told):
    motor, whole = told(), told("--nominal-inertia", "4.2e-4")
    assert whole["nominal_inertia_kg_m2"] == 4.2e-4
    assert whole["excited_s"][0][1] != pytest.approx(motor["excited_s"][0][1], rel=0.01)
    assert whole["rows"][-1]["rigid_nominal"]["least_damped"] == pytest.approx(
        motor["rows"][-1]["rigid_nominal"]["least_damped"], rel=1e-6
    )


@pytest.mark.parametrize("torque", ["motor", "load"])
def test_the_load_s_answer_to_a_torque_is_that_of_an_integration_of_the_loop(told, torque):
    """Motor, load and first-order observer in the time domain."""
    j, tf = DRIVE, 2e-3
    jm, dm, jl = (
        j["motor_inertia_kg_m2"],
        j["motor_friction_n_m_s_rad"],
        j["load_inertia_kg_m2"] / j["gear_ratio"] ** 2,
    )
    on_motor, on_load = (1.0, 0.0) if torque == "motor" else (0.0, 1.0)

    def rate(_, x):
        """Time derivatives; the observer adds Q (u - Jm w' - Dm w) = z - (Jm / Tf) w."""
        twist, speed, load_speed, z = x
        added = z - jm / tf * speed
        spring = j["stiffness_n_m_rad"] * twist + j["elastic_damping_n_m_s_rad"] * (
            speed - load_speed
        )
        motor_rate = (added + on_motor - spring - dm * speed) / jm
        return (
            speed - load_speed,
            motor_rate,
            (spring + on_load) / jl,
            (added - z + (jm / tf - dm) * speed) / tf,
        )

    found = solve_ivp(
        rate, (0.0, 0.7), np.zeros(4), t_eval=np.linspace(0.0, 0.7, 7001), rtol=1e-9, atol=1e-12
    )
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
    assert row["stiff_load"]["frequency_rad_s"] == pytest.approx(
        KNOWN["motor_pole_rad_s"], rel=1e-6
    )


def test_the_tables_say_which_time_constants_to_be_careful_with(rig, tmp_path):
    left, said, _ = rig("servo", "observer", "--plot", tmp_path / "damping.png")
    assert left == 0
    lines = said.splitlines()
    assert any(
        line.startswith("2 ") and "105.433  0.2387" in line and "damps" in line for line in lines
    )
    assert any(line.startswith("→ ∞") and "151.107" in line for line in lines)
    assert "excites the load at T_f → 0, 0.1, 0.5 ms" in " ".join(said.split())
    assert "caution: the load is excited at T_f < 0.704 ms" in said
    assert (tmp_path / "damping.png").stat().st_size > 10_000
    assert "Fitted" in rig("servo", "observer", "--joint", "fitted")[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--joint", "normal"),
            "--joint = 'normal'; must be one of FILE.toml (its [model]), fitted, listed",
        ),
        (("--joint", "mine.toml"), "'mine.toml' cannot be read"),
        (("--order", "9"), "--order = 9; must be 1 to 8"),
        (
            ("--time-constants", "soon"),
            "--time-constants 'soon'; must be numbers separated by commas, in s",
        ),
        (("--time-constants", ","), "--time-constants ','; must be numbers separated by commas"),
        (("--time-constants", "0"), "--time-constants = 0.0; must be"),
        (("--time-constants", "nan"), "--time-constants = nan; must be"),
        (("--nominal-inertia", "-1"), "--nominal-inertia = -1.0; must be"),
        (("--plot", "damping"), "must end in one of"),
    ],
)
def test_invalid_options_are_refused_with_the_bound(rig, words, said):
    left, out, err = rig("servo", "observer", *words)
    assert left == 2
    assert said in " ".join((out + err).split())
