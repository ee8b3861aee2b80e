"""The experiment file: a mistake is named with section, key, value, bound and nearest key."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms.endpoints import choose_ports
from comms.link import LinkFaults
from rig.errors import USAGE, ConfigError, RenamedKey
from rig.run import config
from rig.run.config import Experiment
from rig.run.runtime import bench

SMALLEST = '[experiment]\nname = "mine"\n'
SECTIONS = (
    "experiment, move, model, plan, limits, safety, robot, controller, camera, vision, links, "
    "network, record, can, analysis, drive, joint, bench"
)
LINKS = "reference, setpoint, joint_state, robot_state, platform_1, frame_1, angle_1"
LINKS += ", can_down, can_up"
LINKS += ", platform_2, frame_2, angle_2, platform_3, frame_3, angle_3"


def said(path: Path, text: str) -> str:
    """Error of a file with this text."""
    file = path / "mine.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        config.read_experiment(str(file), [])
    assert error.value.exit_code == USAGE
    return str(error.value)


def said_of_override(override: str) -> str:
    """Error of --set."""
    with pytest.raises(ConfigError) as error:
        config.read_experiment("move", [override])
    return str(error.value)


@pytest.mark.parametrize("name", config.shipped())
def test_every_shipped_experiment_loads_and_bears_its_name(name: str) -> None:
    assert config.read_experiment(name, []).experiment.name == name


def test_there_are_shipped_experiments() -> None:
    assert {"move", "free_decay", "dropouts"} <= set(config.shipped())


def test_the_smallest_file_is_a_name_and_everything_else_has_a_default(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(SMALLEST)
    assert config.read_experiment(str(file), []) == Experiment(
        experiment=config.ExperimentSection(name="mine")
    )


def test_a_whole_number_is_good_where_a_decimal_is_meant() -> None:
    assert config.read_experiment("move", ["move.time_s=2"]).move.time_s == 2.0


MISTAKES = {
    "an unknown section": (
        SMALLEST + "[mov]\ntime_s = 1",
        f"mov: unknown key, did you mean 'move'?; known keys: {SECTIONS}",
    ),
    "an unknown key with a near one": (
        SMALLEST + "[move]\ndistanc_m = 0.2",
        "[move] distanc_m: unknown key, did you mean 'distance_m'?; "
        "known keys: axis, start_m, distance_m, time_s, waypoints, spline, allocation",
    ),
    "an unknown key with none near": (
        SMALLEST + "[plan]\nqqq = 1",
        "[plan] qqq: unknown key; "
        "known keys: input, nonlinear, robust, law, state_weights, input_weight",
    ),
    "an unknown link": (
        SMALLEST + "[links.refrence]\nloss = 0.1",
        f"[links.refrence]: no such link, did you mean 'reference'?; links: {LINKS}",
    ),
    "a link that is not one of data": (
        SMALLEST + "[links.command]\nloss = 0.1",
        f"[links.command]: no such link; links: {LINKS}",
    ),
    "an unknown key of a link": (
        SMALLEST + "[links.angle_1]\ndelay = 3",
        "[links.angle_1] delay: unknown key, did you mean 'delay_ms'?; "
        "known keys: delay_ms, jitter_ms, loss, burst, corrupt",
    ),
    "a link out of bounds": (
        SMALLEST + "[links.angle_1]\nloss = 1.5",
        "[links.angle_1] loss = 1.5: expected `float` < 1.0; correct the value",
    ),
    "a link that is no table": (
        SMALLEST + "[links]\nangle_1 = 3",
        "[links] angle_1 = 3: expected `object`, got `int`; correct the value",
    ),
    "links that are no table": (
        "links = [1]\n" + SMALLEST,
        "links = [1]: expected `object`, got `array`; correct the value",
    ),
    "a section that is no table": (
        "move = 3\n" + SMALLEST,
        "move = 3: expected `object`, got `int`; correct the value",
    ),
    "a missing section": ("", "section experiment: missing; add it"),
    "a missing key": ("[experiment]\nseed = 1", "[experiment] name: missing; add it"),
    "a word for a number": (
        SMALLEST + '[move]\ntime_s = "long"',
        "[move] time_s = 'long': expected `float`, got `str`; correct the value",
    ),
    "a truth value for a number": (
        SMALLEST + "[move]\ntime_s = true",
        "[move] time_s = True: expected `float`, got `bool`; correct the value",
    ),
    "a decimal for a count": (
        SMALLEST + "[camera]\nwidth = 64.5",
        "[camera] width = 64.5: expected `int`, got `float`; correct the value",
    ),
    "a number for a word": (
        SMALLEST + "[plan]\nlaw = 3",
        "[plan] law = 3: expected `str`, got `int`; correct the value",
    ),
    "a number that is none of the allowed": (
        SMALLEST + "[drive]\nsync_ms = 0",
        "[drive] sync_ms = 0: must be one of 1, 5; correct the value",
    ),
    "a word that is none of the allowed": (
        '[experiment]\nname = "mine"\nkind = "mov"',
        "[experiment] kind = 'mov': must be one of 'move', 'free_decay', 'joint', did you mean "
        "'move'?; correct the value",
    ),
    "a name with a blank": (
        '[experiment]\nname = "my run"',
        "[experiment] name = 'my run': expected `str` matching regex "
        "'^[A-Za-z0-9_\\\\-]{1,60}\\\\Z'; correct the value",
    ),
    "a list that is too long": (
        SMALLEST + "[vision]\nrough_pivot_px = [1, 2, 3]",
        "[vision] rough_pivot_px = [1, 2, 3]: expected `array` of length 2, got 3; "
        "correct the value",
    ),
    "a wrong element of a list": (
        SMALLEST + '[vision]\nrough_pivot_px = [1, "a"]',
        "[vision.rough_pivot_px] 1 = 'a': expected `float`, got `str`; correct the value",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_file_is_named(mistake: str, tmp_path: Path) -> None:
    text, expected = MISTAKES[mistake]
    assert said(tmp_path, text) == expected


OUT_OF_BOUNDS = [
    ("experiment.seed", -1, ">= 0"),
    ("experiment.quiet_s", -0.1, ">= 0"),
    ("experiment.quiet_s", 601, "<= 600"),
    ("experiment.watch_s", 0, ">= 0.1"),
    ("move.start_m", -11, ">= -10"),
    ("move.distance_m", 20, "<= 10"),
    ("move.time_s", 0, "> 0"),
    ("model.length_m", 0, "> 0"),
    ("model.damping_ratio", 1, "< 1"),
    ("model.gravity_m_s2", -9.81, "> 0"),
    ("limits.speed_m_s", 0, "> 0"),
    ("limits.acceleration_m_s2", -5, "> 0"),
    ("safety.position_min_m", -20, ">= -10"),
    ("safety.speed_m_s", 0, "> 0"),
    ("safety.reference_stale_ms", 29, ">= 30"),
    ("safety.angle_stale_ms", 99, ">= 100"),
    ("safety.initial_swing_rad", 2, "<= 1.6"),
    ("camera.width", 63, ">= 64"),
    ("camera.height", 5000, "<= 4096"),
    ("camera.rate_hz", 201, "<= 200"),
    ("vision.average_frames", 0, ">= 1"),
    ("vision.processing_ms", 1001, "<= 1000"),
    ("vision.rough_pixels_per_m", 0, "> 0"),
    ("record.pictures_hz", 51, "<= 50"),
    ("links.reference.delay_ms", -1, ">= 0"),
    ("links.reference.burst", 0, ">= 1"),
]


@pytest.mark.parametrize(("key", "value", "bound"), OUT_OF_BOUNDS)
def test_a_value_out_of_bounds_is_named_with_the_bound(key: str, value: float, bound: str) -> None:
    section, _, name = key.rpartition(".")
    text = said_of_override(f"{key}={value}")
    assert text.startswith(f"[{section}] {name} = {value}: expected ")
    assert bound in text


def bounded_numbers(
    kind: type[msgspec.Struct] = Experiment, path: tuple[str, ...] = ()
) -> Iterator[str]:
    """Keys of all numbers of the file."""
    for field in msgspec.structs.fields(kind):
        if isinstance(field.type, type) and issubclass(field.type, config.Section):
            yield from bounded_numbers(field.type, (*path, field.name))
        elif isinstance(field.default, int | float) or field.name in (
            "speed_m_s",
            "acceleration_m_s2",
        ):
            yield ".".join((*path, field.name))


@pytest.mark.parametrize("key", list(bounded_numbers()))
@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_every_number_of_the_file_must_be_finite(key: str, value: str) -> None:
    assert said_of_override(f"{key}={value}").startswith(
        f"[{key.rpartition('.')[0]}] {key.rpartition('.')[2]} = {value}: "
    )


def test_the_table_of_numbers_is_not_empty() -> None:
    assert {"move.time_s", "safety.speed_m_s", "camera.width"} <= set(bounded_numbers())


def test_a_file_that_is_no_toml_is_named_with_the_line(tmp_path: Path) -> None:
    text = said(tmp_path, "[experiment]\nname = \n")
    assert "is not valid TOML" in text
    assert "line 2" in text


def test_a_file_that_is_no_text_is_refused_in_words(tmp_path: Path) -> None:
    file = tmp_path / "picture.toml"
    file.write_bytes(bytes(range(128, 256)))
    with pytest.raises(ConfigError, match="is not valid TOML"):
        config.read_experiment(str(file), [])


@pytest.mark.parametrize("port", [-1, 80, 1023, 65_519, 999_999])
def test_a_first_port_that_no_run_may_use_is_refused(port: int) -> None:
    assert said_of_override(f"network.base_port={port}") == (
        f"[network] base_port = {port}; must be 1024 to 65508, the first of 28 ports, "
        "or 0 for free ones"
    )


@pytest.mark.parametrize("port", [0, 1024, 65_508])
def test_a_first_port_leaves_room_for_all_ports_of_a_run(port: int) -> None:
    chosen = config.read_experiment("move", [f"network.base_port={port}"]).network.base_port
    assert chosen == port
    if port:
        assert max(choose_ports("127.0.0.1", port)) <= 65_535


BEYOND = (
    "must be an address of this machine alone, 127.0.0.1 to 127.255.255.254: "
    "the links have no keys, so none may be reached from outside"
)


@pytest.mark.parametrize("bind", ["0.0.0.0", "10.0.0.1", "128.0.0.1", "localhost", "", "::1"])
def test_an_address_beyond_this_machine_is_refused(tmp_path: Path, bind: str) -> None:
    told = f"[network] bind = {bind!r}; {BEYOND}"
    assert said_of_override(f"network.bind={bind}") == told
    assert said(tmp_path, SMALLEST + f'[network]\nbind = "{bind}"\n') == told


@pytest.mark.parametrize("bind", ["127.0.0.1", "127.0.0.9", "127.255.255.254"])
def test_an_address_of_this_machine_alone_is_taken(bind: str) -> None:
    assert config.read_experiment("move", [f"network.bind={bind}"]).network.bind == bind


def test_the_command_line_refuses_an_address_beyond_this_machine(rig: Any, tmp_path: Path) -> None:
    code, _, why = rig("run", "move", "--set", "network.bind=0.0.0.0")
    assert code == 2
    assert f"[network] bind = '0.0.0.0'; {BEYOND}" in " ".join(why.split())
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize("bus", ["ipc", "tcp"])
def test_the_bus_is_of_local_sockets_or_of_ports(bus: str) -> None:
    assert config.read_experiment("move", [f"network.bus={bus}"]).network.bus == bus


def test_the_bus_is_of_local_sockets_unless_ports_are_asked_for() -> None:
    assert config.read_experiment("move", []).network.bus == "ipc"


@pytest.mark.parametrize("bus", ["udp", "IPC", "", "inproc"])
def test_another_kind_of_bus_is_refused(bus: str) -> None:
    told = f"[network] bus = '{bus}': must be one of 'ipc', 'tcp'"
    assert said_of_override(f"network.bus={bus}").startswith(told)


DEEP = 5_000
NESTED = {
    "lists": f"[bench.pendulum]\nx = {'[' * DEEP}{']' * DEEP}\n",
    "tables in a line": f"[bench.pendulum]\nx = {'{a=' * DEEP}1{'}' * DEEP}\n",
    "a dotted key": f"[bench.pendulum]\n{'.'.join('a' * DEEP)} = 1\n",
    "a header": f"[bench.pendulum.{'.'.join('a' * DEEP)}]\nx = 1\n",
}


@pytest.mark.parametrize("how", NESTED)
def test_a_file_nested_without_end_is_refused_in_words(tmp_path: Path, how: str) -> None:
    text = said(tmp_path, NESTED[how])
    assert "has tables or lists within each other; must be <= 32 deep" in text
    assert len(text) < 500


@pytest.mark.parametrize(
    "override", ["bench.pendulum.x=" + "[" * DEEP + "]" * DEEP, "bench." + "a." * DEEP + "x=1"]
)
def test_a_value_nested_without_end_is_refused_in_words(override: str) -> None:
    text = said_of_override(override)
    assert "must be <= 32 deep" in text
    assert len(text) < 500


@pytest.mark.parametrize(
    "override", ['experiment.name="abc\\n"', 'bench.camera.name="red_plane\\n"']
)
def test_a_name_is_checked_to_its_very_end(override: str) -> None:
    with pytest.raises(ConfigError, match="matching regex"):
        bench.params(config.read_experiment("move", [override]))


def test_a_missing_file_is_answered_with_what_is_shipped() -> None:
    with pytest.raises(ConfigError) as error:
        config.read_experiment("mov", [])
    assert str(error.value) == (
        "experiment 'mov': no such file and not a shipped experiment, did you mean 'move'?; "
        "`rig run --list` names the shipped ones"
    )


def test_a_folder_is_no_experiment(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="a folder; must be a TOML file"):
        config.read_experiment(str(tmp_path), [])


def test_a_file_that_cannot_be_read_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(SMALLEST)

    def locked(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_text", locked)
    with pytest.raises(
        ConfigError, match=r"mine\.toml' cannot be read: Permission denied; check the file"
    ):
        config.read_experiment(str(file), [])


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        pytest.param("move.distance_m=0.1", ("move", "distance_m"), 0.1, id="a_number"),
        pytest.param(
            "move.distance_m = 0.1", ("move", "distance_m"), 0.1, id="blanks_around_the_sign"
        ),
        pytest.param(
            "experiment.planner=line",
            ("experiment", "planner"),
            "line",
            id="a_bare_word_is_a_string",
        ),
        pytest.param(
            'experiment.planner="line"', ("experiment", "planner"), "line", id="a_quoted_word"
        ),
        pytest.param(
            "experiment.purpose=a = b",
            ("experiment", "purpose"),
            "a = b",
            id="the_first_sign_splits",
        ),
        pytest.param(
            "record.pictures_hz=0", ("record", "pictures_hz"), 0.0, id="a_section_the_file_has_not"
        ),
        pytest.param(
            "vision.rough_pivot_px=[1, 2]", ("vision", "rough_pivot_px"), (1.0, 2.0), id="a_list"
        ),
    ],
)
def test_an_override_wins_over_the_file(
    override: str, path: tuple[str, str], value: object
) -> None:
    got: Any = config.read_experiment("move", [override])
    for name in path:
        got = getattr(got, name)
    assert got == value


def test_overrides_make_links_and_reach_the_bench() -> None:
    e = config.read_experiment(
        "move",
        ["links.angle_1.loss=0.5", "bench.pendulum.length_m=0.7", "links.angle_1.loss=0.25"],
    )
    assert e.links["angle_1"].loss == 0.25
    assert e.bench.pendulum["length_m"] == 0.7


OLD_LINKS = [("platform", "platform_1"), ("frame", "frame_1"), ("angle", "angle_1")]


@pytest.mark.parametrize(("old", "new"), OLD_LINKS)
def test_a_link_of_an_old_name_is_read_under_its_new_one_with_a_note(
    tmp_path: Path, old: str, new: str
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(SMALLEST + f"[links.{old}]\nloss = 0.5\ndelay_ms = 3")
    with pytest.warns(RenamedKey) as notes:
        e = config.read_experiment(str(file), [])
    (note,) = notes
    assert str(note.message) == (
        f"[links.{old}] is now called [links.{new}]; rename it in the file"
    )
    assert e.links == {new: LinkFaults(loss=0.5, delay_ms=3.0)}


@pytest.mark.parametrize(("old", "new"), OLD_LINKS)
def test_a_link_under_both_names_is_refused(tmp_path: Path, old: str, new: str) -> None:
    assert said(tmp_path, SMALLEST + f"[links.{old}]\nloss = 0.5\n[links.{new}]\nloss = 0.5") == (
        f"[links.{old}] and [links.{new}] are the same table; must stand once: keep [links.{new}]"
    )


def test_an_override_of_an_old_link_is_read_under_its_new_name_with_a_note() -> None:
    with pytest.warns(RenamedKey, match=r"\[links\.angle\] is now called \[links\.angle_1\]"):
        e = config.read_experiment("move", ["links.angle.loss=0.5"])
    assert e.links["angle_1"].loss == 0.5
    assert "angle" not in e.links


def test_an_override_of_an_old_link_changes_the_new_one_of_the_file() -> None:
    with pytest.warns(RenamedKey, match=r"\[links\.frame\] is now called \[links\.frame_1\]"):
        changed = config.read_experiment("move", ["links.frame.loss=0.5"])
    assert changed.links["frame_1"] == LinkFaults(delay_ms=8.0, loss=0.5)


def test_a_mistake_in_a_link_of_an_old_name_is_named_under_the_new_one(tmp_path: Path) -> None:
    with pytest.warns(RenamedKey):
        complaint = said(tmp_path, SMALLEST + "[links.angle]\nloss = 1.5")
    assert complaint == "[links.angle_1] loss = 1.5: expected `float` < 1.0; correct the value"


def test_an_override_leaves_everything_else_as_it_was() -> None:
    plain, changed = (
        config.read_experiment("move", []),
        config.read_experiment("move", ["move.time_s=2.5"]),
    )
    assert msgspec.structs.replace(changed, move=plain.move) == plain


@pytest.mark.parametrize(
    "text", ["move.time_s", "=1", "time_s=1", "move=1", "move..time_s=1", ".time_s=1", ""]
)
def test_an_override_of_another_form_is_answered_with_an_example(text: str) -> None:
    assert (
        said_of_override(text)
        == f"--set '{text}': must be section.key=value, for example --set move.distance_m=0.1"
    )


def test_an_override_below_a_value_is_refused() -> None:
    assert (
        said_of_override("move.time_s.x=1")
        == "--set 'move.time_s.x=1': 'time_s' is a value, not a section"
    )


def test_an_override_is_checked_like_the_file() -> None:
    assert said_of_override("move.tim_s=1").startswith(
        "[move] tim_s: unknown key, did you mean 'time_s'?"
    )
    assert (
        said_of_override("move.time_s=")
        == "[move] time_s = '': expected `float`, got `str`; correct the value"
    )


def test_a_free_decay_moves_nothing_and_a_move_moves() -> None:
    assert not config.read_experiment("free_decay", []).has_move
    assert config.read_experiment("move", []).has_move


def places(tables: dict[str, Any], above: tuple[str, ...] = ()) -> Iterator[str]:
    """Every key of two levels or more."""
    for key, value in tables.items():
        if above:
            yield ".".join((*above, key))
        if isinstance(value, dict):
            yield from places(value, (*above, key))


PLACES = sorted(places(msgspec.to_builtins(config.read_experiment("dropouts", []))))
VALUES = st.one_of(
    st.recursive(
        st.one_of(
            st.booleans(), st.integers(-(2**70), 2**70), st.floats(), st.text("abc", max_size=4)
        ),
        lambda inside: st.lists(inside, max_size=3),
        max_leaves=4,
    ).map(json.dumps),
    st.sampled_from(["{}", "{a = 1}", "[{a = 1}]", "1979-05-27", "07:32:00", "nan", "-inf"]),
    st.text(max_size=6),
)


@settings(max_examples=60)
@given(place=st.sampled_from(PLACES), tail=st.sampled_from(["", "", ".a", "x"]), value=VALUES)
def test_any_content_of_the_file_is_an_experiment_or_an_error_in_words(
    place: str, tail: str, value: str
) -> None:
    key = place + tail
    got = outcome(f"{key}={value}")
    if isinstance(got, str):
        assert key.split(".")[0] in got
        assert len(got) > len(key) + 10
    else:
        known = msgspec.structs.replace(
            got, bench=config.BenchSection()
        )  # its tables are checked by the bench
        assert msgspec.json.decode(msgspec.json.encode(known), type=Experiment) == known


def outcome(override: str) -> Experiment | str:
    """Experiment, or the text of its error."""
    try:
        return config.read_experiment("dropouts", [override])
    except ConfigError as error:
        return str(error)


def test_a_policy_that_does_not_exist_is_named() -> None:
    said = said_of_override("controller.policy=hold")
    assert "[controller]" in said
    assert "policy" in said
    assert "hold" in said
