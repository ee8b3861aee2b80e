"""The calibration file: what is written is read back, and a file that does not fit is refused."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.errors import ConfigError
from rig.run import config
from rig.run.calibration import file as calibration_file
from rig.run.calibration.file import Calibration
from rig.run.cameras import cameras
from rig.run.config import Experiment
from rig.run.toml_file import convert
from rig.run.vision_settings import vision_settings
from vision.offset_table import OffsetTable
from vision.task import VisionSettings

CALIBRATION = Calibration(
    made="2026-01-02T03:04:05+00:00",
    camera="red_plane",
    seed=1,
    width=640,
    height=480,
    pivot_home_px=(320.25, -58.5),
    pixels_per_m=1005.0625,
    x_m=[-0.2, 0.0, 0.2],
    offset_rad=[0.0035, 1e-6, -0.0035],
    sigma_offset_rad=[4e-7, 4e-7, 4e-7],
)


def asking_for(calibration: str, *overrides: str) -> Experiment:
    """Shipped move with another calibration."""
    base = config.read_experiment("move", list(overrides))
    return msgspec.structs.replace(
        base, vision=msgspec.structs.replace(base.vision, calibration=calibration)
    )


def found_in(experiment: Experiment) -> tuple[str, Calibration | None]:
    """Name and contents of the calibration of the first camera."""
    return calibration_file.find(experiment, cameras(experiment)[0])


def saved(path: Path, calibration: Calibration = CALIBRATION) -> str:
    """Write a calibration; return the name of the file."""
    file = path / "calibration.toml"
    calibration_file.save(calibration, file)
    return str(file)


def refusal(calibration: str, *overrides: str) -> str:
    """Error text of a refused calibration."""
    with pytest.raises(ConfigError) as error:
        found_in(asking_for(calibration, *overrides))
    return str(error.value)


def test_a_calibration_survives_the_file(tmp_path: Path) -> None:
    name = saved(tmp_path)
    assert found_in(asking_for(name)) == (name, CALIBRATION)


finite = st.floats(-1e4, 1e4)


@given(
    camera=st.text(
        st.characters(exclude_categories=["Cs"], exclude_characters="\x7f"), max_size=12
    ),
    pivot=st.tuples(finite, finite),
    scale=st.floats(0.1, 1e5),
    rows=st.lists(
        st.tuples(finite, finite, finite), min_size=1, max_size=6, unique_by=lambda row: row[0]
    ),
)
def test_any_name_and_any_numbers_survive_the_file_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory,
    camera: str,
    pivot: tuple[float, float],
    scale: float,
    rows: list[tuple[float, float, float]],
) -> None:
    x_m, offset_rad, sigma_rad = (list(column) for column in zip(*sorted(rows), strict=True))
    calibration = msgspec.structs.replace(
        CALIBRATION,
        camera=camera,
        pivot_home_px=pivot,
        pixels_per_m=scale,
        x_m=x_m,
        offset_rad=offset_rad,
        sigma_offset_rad=sigma_rad,
    )
    name = saved(tmp_path_factory.getbasetemp(), calibration)
    assert calibration_file.read(Path(name)) == calibration


def test_numbers_of_numpy_are_written_as_plain_numbers(tmp_path: Path) -> None:
    x_m = [float(x) for x in np.linspace(-0.2, 0.2, 3)]
    of_numpy = msgspec.structs.replace(
        CALIBRATION, x_m=list(np.array(x_m)), seed=np.int64(1), pixels_per_m=np.float64(1005.0625)
    )
    name = saved(tmp_path, of_numpy)
    assert found_in(asking_for(name))[1] == msgspec.structs.replace(CALIBRATION, x_m=x_m)


def test_saving_makes_the_folder_it_is_to_lie_in(tmp_path: Path) -> None:
    name = saved(tmp_path / "not" / "yet" / "there")
    assert found_in(asking_for(name))[1] == CALIBRATION


def test_shipped_is_the_newest_one_shipped_and_fits_the_shipped_experiments() -> None:
    newest = config.shipped_calibrations()[-1]
    for experiment in config.shipped():
        chosen = config.read_experiment(experiment, [])
        if not chosen.camera.rate_hz:
            continue
        name, calibration = found_in(chosen)
        assert name == newest
        assert calibration is not None
        assert calibration == convert(config.read_shipped_calibration(newest), Calibration)


@pytest.mark.parametrize(
    ("calibration", "override"),
    [
        pytest.param("none", "camera.rate_hz=50", id="none_asked_for"),
        pytest.param("shipped", "camera.rate_hz=0", id="no_camera"),
        pytest.param("nowhere.toml", "camera.rate_hz=0", id="no_camera_and_no_file"),
    ],
)
def test_no_calibration_is_read_when_none_is_needed(calibration: str, override: str) -> None:
    assert found_in(asking_for(calibration, override)) == (calibration, None)


def test_a_missing_file_is_answered_with_how_to_make_one() -> None:
    text = refusal("nowhere.toml")
    assert text.startswith(
        "[vision] calibration = 'nowhere.toml': no such file; make one with `rig calibrate offsets`"
    )
    assert config.shipped_calibrations()[-1] in text


def test_shipped_is_refused_when_none_is_shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "shipped_calibrations", list)
    assert refusal("shipped") == (
        "[vision] calibration = 'shipped': none is shipped; make one with `rig calibrate offsets`"
    )


@pytest.mark.parametrize("override", ["camera.width=320", "camera.height=240"])
def test_a_calibration_of_another_picture_size_is_refused_with_both_sizes(
    override: str, tmp_path: Path
) -> None:
    text = refusal(saved(tmp_path), override)
    key, _, size = override.partition("=")
    expected = (int(size), 480) if key.endswith("width") else (640, int(size))
    assert (
        f"is for pictures of (640, 480); must be {expected} as in [camera]: calibrate again" in text
    )


@pytest.mark.parametrize(
    ("line", "instead", "expected"),
    [
        pytest.param("width = 640", "", "[calibration] width: missing; add it", id="a_missing_key"),
        pytest.param(
            "width = 640",
            'width = "a"',
            "[calibration] width = 'a': expected `int`, got `str`",
            id="a_wrong_type",
        ),
        pytest.param(
            "seed = 1",
            "seed = 1\nsed = 2",
            "[calibration] sed: unknown key, did you mean 'seed'?",
            id="unknown",
        ),
        pytest.param(
            "pixels_per_m = 1005.0625",
            "pixels_per_m = 0",
            "[calibration] pixels_per_m = 0: ",
            id="no_scale",
        ),
        pytest.param(
            "pixels_per_m = 1005.0625",
            "pixels_per_m = nan",
            "[calibration] pixels_per_m = nan",
            id="nan_scale",
        ),
        pytest.param(
            "[320.25, -58.5]", "[nan, -58.5]", "[calibration.pivot_home_px] 0 = nan", id="nan_pivot"
        ),
        pytest.param(
            "x_m = [-0.2, 0.0, 0.2]",
            "x_m = [-0.2, 0.2]",
            "2 positions and 3 offsets",
            id="uneven_lists",
        ),
        pytest.param(
            "x_m = [-0.2, 0.0, 0.2]",
            "x_m = [0.2, 0.0, -0.2]",
            "must increase",
            id="falling_positions",
        ),
        pytest.param(
            "[0.0035, 1e-06, -0.0035]", "[0.0035, nan, -0.0035]", "must be finite", id="nan_offset"
        ),
        pytest.param('made = "', "made = ", "is not valid TOML", id="no_toml"),
    ],
)
def test_a_broken_file_is_refused_before_anything_starts(
    line: str, instead: str, expected: str, tmp_path: Path
) -> None:
    file = Path(saved(tmp_path))
    text = file.read_text()
    assert line in text
    file.write_text(text.replace(line, instead))
    assert expected in refusal(str(file))


IN_LIGHT = msgspec.structs.replace(CALIBRATION, background=200.0)
DARKER = msgspec.structs.replace(
    CALIBRATION, background=90.0, offset_rad=[offset - 1e-3 for offset in CALIBRATION.offset_rad]
)


def test_offsets_in_another_light_are_added_to_a_file_and_survive_it(tmp_path: Path) -> None:
    both = calibration_file.with_light(IN_LIGHT, DARKER, "cal.toml")
    assert (both.background, both.offset_rad) == (200.0, IN_LIGHT.offset_rad)
    assert both.light_offsets() == [(90.0, DARKER.offset_rad)]
    name = saved(tmp_path, both)
    assert found_in(asking_for(name)) == (name, both)


@pytest.mark.parametrize(
    ("old", "change", "told"),
    [
        (IN_LIGHT, {"camera": "other"}, "is for camera = 'red_plane'; must be for 'other'"),
        (IN_LIGHT, {"width": 320}, "is for width = 640; must be for 320"),
        (IN_LIGHT, {"background": 200.4}, "lights of 200.0 and 200.4 grey levels; must be 1 apart"),
        (CALIBRATION, {}, "the first without its level"),
    ],
)
def test_a_light_that_does_not_fit_the_file_is_refused(
    old: calibration_file.Calibration, change: dict[str, object], told: str
) -> None:
    new = msgspec.structs.replace(DARKER, **change)
    with pytest.raises(ConfigError, match=told):
        calibration_file.with_light(old, new, "cal.toml")


def test_a_tour_of_other_positions_is_not_added() -> None:
    moved = [x + 0.01 for x in DARKER.x_m]
    new = msgspec.structs.replace(DARKER, x_m=moved)
    with pytest.raises(ConfigError, match=r"has positions .*; must be .* to 1 mm as in this run"):
        calibration_file.with_light(IN_LIGHT, new, "cal.toml")


def test_the_tracker_is_given_the_offsets_of_every_light(tmp_path: Path) -> None:
    both = calibration_file.with_light(IN_LIGHT, DARKER, "cal.toml")
    chosen = asking_for(saved(tmp_path, both))
    (camera,) = cameras(chosen)
    settings = vision_settings(chosen, camera, both)
    again = msgspec.json.decode(msgspec.json.encode(settings), type=VisionSettings)
    table = OffsetTable(again.x_m, again.offset_rad, again.background, again.lights)
    middle = 0.5 * (IN_LIGHT.offset_rad[0] + DARKER.offset_rad[0])
    assert table.at(both.x_m[0], 145.0).offset_rad == pytest.approx(middle)
