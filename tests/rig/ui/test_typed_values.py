"""Values as people type them: with a unit, in centimetres or degrees, nothing at all."""

import pytest

ABSURD = {
    "a cable in cm": (["plan", "--length", "98"], "In metres 98 cm are 0.98"),
    "a move in cm": (["plan", "--distance", "20"], "In metres 20 cm are 0.2"),
    "a start in degrees": (
        ["plan", "--start", "angle_rad=5"], "In radians 5° are 0.08727",
    ),
    "a load in cm": (["laws", "compare", "--load-length", "98"], "In metres 98 cm are 0.98"),
    "a model in cm": (
        ["run", "--virtual", "--set", "model.length_m=98"],
        "[model] length_m = 98: a cable of 98 m? In metres 98 cm are 0.98",
    ),
    "a simulated cable in cm": (
        ["run", "--virtual", "--set", "bench.pendulum.length_m=98"], "In metres 98 cm are 0.98",
    ),
    "a bound in degrees": (
        ["run", "--virtual", "--set", "safety.initial_swing_rad=90"],
        "in radians 90° are 1.571",
    ),
    "a distance in cm": (
        ["run", "--virtual", "--set", "move.distance_m=20"], "in metres 20 cm are 0.2",
    ),
    "millimetres": (
        ["plan", "--length", "980mm"],
        "--length 980mm: carries a unit; type the number alone, in m: 0.98",
    ),
    "seconds": (
        ["plan", "--time=2s"], "--time 2s: carries a unit; type the number alone, in s: 2",
    ),
    "a speed": (["laws", "compare", "--vmax", "1m/s"], "in m/s: 1"),
    "a sample time": (["servo", "notch", "--sample-time", "1ms"], "in s: 0.001"),
    "a foreign unit": (["plan", "--length", "3ft"], "type the number alone, in m"),
    "a key with a unit": (
        ["run", "--virtual", "--set", "move.time_s=2s"], "type the number alone, in s: 2",
    ),
    "a folder": (["run", "."], "experiment '.': a folder; must be a TOML file"),
    "a port that is none": (
        ["doctor", "--base-port", "999999"], "--base-port = 999999; must be 1024 to 65508",
    ),
    "a port of the system": (
        ["doctor", "--base-port", "80"], "--base-port = 80; must be 1024 to 65508",
    ),
    "a port by key": (
        ["run", "--virtual", "--set", "network.base_port=80"], "[network] base_port = 80; must be",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ABSURD)
def test_a_value_in_another_unit_is_refused_with_the_value_to_type(rig, tmp_path, name):
    words, told = ABSURD[name]
    code, said, why = rig(*words)
    assert (code, said.strip()) == (2, "")
    assert told in why
    assert not (tmp_path / "runs").exists()


STRANGE = {
    "a long cable": (["plan", "--length", "6"], "note: --length 6: a cable of 6 m?"),
    "a large angle": (["plan", "--start", "angle_rad=0.7"], "a swing of 0.7 rad?"),
    "many turns": (
        ["motor-check", "--example", "1", "--angle", "90"], "In radians 90° are 1.571",
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", STRANGE)
def test_a_value_that_is_allowed_but_strange_gets_a_note(rig, name):
    words, told = STRANGE[name]
    code, said, why = rig(*words)
    assert code != 2
    assert said
    assert told in why
    assert why.startswith("rig: note: ")


@pytest.mark.parametrize("length", ["0.3", "0.98", "2.5", "5"])
def test_a_cable_of_a_laboratory_gets_no_note(rig, length):
    code, _, why = rig("plan", "--length", length, "--time", "4")
    assert (code, why) == (0, "")


def test_a_move_of_nothing_is_said_to_be_one(rig):
    code, said, _ = rig("plan", "--distance", "0")
    assert (code, said) == (
        0, "--distance 0: nothing is to be done, the platform stands still\n",
    )  # fmt: skip
    _, said, _ = rig("plan", "--distance", "0", "--start", "angle_rad=0.05")
    assert "peak swing" in said


@pytest.mark.parametrize("times", ["5e-4,2e-3", "1e9", "1E-3", ".002", "2."])
def test_a_number_in_any_notation_is_no_number_with_a_unit(rig, times):
    code, _, why = rig("servo", "observer", "--time-constants", times)
    assert (code, why) == (0, "")


def test_a_file_nested_without_end_is_an_error_in_words(rig, tmp_path):
    (tmp_path / "deep.toml").write_text(f"x = {'[' * 5_000}{']' * 5_000}\n")
    for verb in (["run"], ["size"], ["motor-check"], ["servo", "compare"]):
        code, _, why = rig(*verb, "deep.toml")
        assert code == 2
        assert "must be <= 32 deep" in why
