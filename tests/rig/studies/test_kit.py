"""Benchmark of trackers: ours at its limit, and every fault of another author's tracker named."""

from __future__ import annotations

import math
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from rig.errors import ConfigError
from rig.studies.vision import kit
from rig.studies.vision.junit import write_junit
from rig.studies.vision.scene import SceneFrame, picture_size, read_scene
from vision.protocol import CableAngle

WORKING = """
class Steady:
    def __init__(self, width, height):
        pass

    def measure(self, image, pivot_px):
        return Result()

class Result:
    angle_rad = None
    sigma_rad = None
"""


class Blind:
    """Tracker that refuses every picture."""

    def __init__(self, width, height):
        self.size = (width, height)

    def measure(self, image, pivot_px):
        return CableAngle()


class Careless(Blind):
    """Tracker that always gives the same angle."""

    def measure(self, image, pivot_px):
        return CableAngle(0.7, 1e-3)


@pytest.fixture
def write_module(monkeypatch, tmp_path):
    """Write a module into the current folder; the interpreter forgets it afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)

    def write(name, text):
        (tmp_path / f"{name}.py").write_text(text)

    yield write
    for name in set(sys.modules) - before:
        if getattr(sys.modules[name], "__file__", None) == str(tmp_path / f"{name}.py"):
            del sys.modules[name]


def refusal(tracker_class, scene="clean"):
    """Message about a tracker that fails on its first frames."""
    with pytest.raises(ConfigError) as caught:
        kit.run([scene], {"mine": tracker_class}, frames=3)
    message = str(caught.value)
    assert "\n" not in message
    assert caught.value.__cause__ is None
    return message


def answering(result):
    """Class whose trackers give this result for every picture."""

    class Answering(Blind):
        def measure(self, image, pivot_px):
            return result

    return Answering


def test_ours_is_at_the_bound_on_a_clean_scene_and_refuses_a_hidden_cable() -> None:
    clean, hidden = kit.run(["clean", "no_cable"], kit.OURS, frames=40)
    assert (clean.scene, clean.tracker, clean.passed) == ("clean", "ours", True)
    assert (clean.score.frames, clean.score.refused, clean.score.wrong) == (40, 0, 0)
    assert 0.8 < clean.score.std_over_bound < 1.3
    assert 0.8 < clean.score.error_over_sigma < 1.3
    assert abs(clean.score.bias_rad) < 1e-5
    assert clean.seconds > 0.0
    assert (hidden.expect, hidden.passed) == ("refuse", True)
    assert (hidden.score.refused, hidden.score.wrong) == (40, 0)


def test_results_come_scene_by_scene_and_the_peers_measure_one_frame_in_ten() -> None:
    done: list[int] = []
    results = kit.run(["no_cable", "clean"], kit.OURS | kit.PEERS, 11, done.append)
    assert [(result.scene, result.tracker) for result in results] == [
        *(("no_cable", name) for name in ("ours", "lsd", "parabola")),
        *(("clean", name) for name in ("ours", "lsd", "parabola")),
    ]
    assert [result.score.frames for result in results] == [11, 2, 2, 11, 2, 2]
    assert [result.score.wrong for result in results] == [0] * 6
    assert done == list(range(1, 23))


def test_a_tracker_that_gives_an_angle_of_a_hidden_cable_fails() -> None:
    (result,) = kit.run(["no_cable"], {"mine": Careless}, frames=4)
    assert result.failures == ["silently wrong pictures 4; must be <= 0"]
    assert not result.passed


def test_a_tracker_is_new_for_each_scene_and_has_the_size_of_its_pictures() -> None:
    made = []

    class Counted(Blind):
        def __init__(self, width, height):
            super().__init__(width, height)
            self.shapes = []
            made.append(self)

        def measure(self, image, pivot_px):
            self.shapes.append(image.shape)
            return CableAngle()

    kit.run(["clean", "no_cable"], {"mine": Counted}, frames=2)
    assert [tracker.size for tracker in made] == [
        picture_size(read_scene(name)) for name in ("clean", "no_cable")
    ]
    assert [tracker.shapes for tracker in made] == [[one.size[::-1]] * 2 for one in made]


def test_a_tracker_that_draws_into_its_picture_changes_that_of_no_other() -> None:
    seen = []

    class Drawing(Blind):
        def measure(self, image, pivot_px):
            assert image.flags.c_contiguous
            assert image.dtype == np.uint8
            seen.append(image.copy())
            image[:] = 0
            return CableAngle()

    kit.run(["clean"], {"first": Drawing, "second": Drawing}, frames=1)
    np.testing.assert_array_equal(seen[0], seen[1])
    assert seen[0].any()


@pytest.mark.parametrize("is_colour_scene", [True, False])
def test_a_colour_tracker_is_given_three_planes_and_a_grey_one_the_red(
    monkeypatch, is_colour_scene
) -> None:
    size = picture_size(read_scene("clean"))
    planes = (10, 20, 30) if is_colour_scene else (30, 30, 30)
    picture = np.zeros((*size[::-1], 3), np.uint8) + np.array(planes, np.uint8)
    if not is_colour_scene:
        picture = picture[:, :, 0]
    frame = SceneFrame(0, 0.0, picture, (1.0, -2.0), None, None, 0.0)
    monkeypatch.setattr(kit, "scene_frames", lambda scene, frames: iter([frame]))
    given = {}

    class Grey(Blind):
        def measure(self, image, pivot_px):
            given[type(self).__name__] = (image[0, 0].tolist(), image.flags.c_contiguous, pivot_px)
            return CableAngle()

    class Colour(Grey):
        colour = True

    kit.run(["clean"], {"grey": Grey, "colour": Colour}, frames=1)
    assert given["Grey"] == (30, True, (1.0, -2.0))
    assert given["Colour"] == (list(planes), True, (1.0, -2.0))


def test_a_tracker_in_the_current_folder_is_found(write_module) -> None:
    write_module("steady_tracker", WORKING)
    found = kit.load_tracker("steady_tracker:Steady")
    (result,) = kit.run(["no_cable"], {"steady": found}, frames=2)
    assert result.score.refused == 2


@pytest.mark.parametrize("name", ["Steady", "steady.py:Steady:x", ":Steady", "steady:", "a b:C"])
def test_a_name_of_another_form_is_refused_with_an_example(name) -> None:
    with pytest.raises(ConfigError, match=r"must be package\.module:Class: for example"):
        kit.load_tracker(name)


def test_a_module_that_is_not_there_is_named_with_the_folder(write_module, tmp_path) -> None:
    with pytest.raises(ConfigError) as caught:
        kit.load_tracker("no_such_tracker:Any")
    assert "module no_such_tracker cannot be imported (ModuleNotFoundError" in str(caught.value)
    assert str(tmp_path) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("broken_syntax", "class :", "SyntaxError"),
        ("broken_import", "import no_such_library", r"'no_such_library' at broken_import.py:1\)"),
        ("broken_code", "\n1 / 0\n", r"ZeroDivisionError: division by zero at broken_code.py:2\)"),
    ],
)
def test_a_module_that_cannot_be_imported_is_named_with_the_reason(
    write_module, name, text, reason
) -> None:
    write_module(name, text)
    with pytest.raises(ConfigError, match=f"module {name} cannot be imported .*{reason}"):
        kit.load_tracker(f"{name}:Any")


def test_a_class_that_is_not_in_the_module_is_named_with_those_that_are(write_module) -> None:
    write_module("other_class", WORKING)
    with pytest.raises(ConfigError, match=r"no class Stedy in .*must be one of Steady, Result"):
        kit.load_tracker("other_class:Stedy")


def test_a_class_without_a_method_is_refused(write_module) -> None:
    write_module("no_method", "class Empty:\n    measure = 3\n")
    with pytest.raises(ConfigError, match=r"without a method measure; must have measure\(image"):
        kit.load_tracker("no_method:Empty")


def test_a_method_of_other_arguments_is_refused() -> None:
    class OneArgument(Blind):
        def measure(self, image):
            return CableAngle()

    assert "measure does not take two arguments" in refusal(OneArgument)


def test_a_constructor_that_fails_is_named_with_the_size() -> None:
    class Fussy(Blind):
        def __init__(self, width, height):
            raise RuntimeError("no weights")

    width, height = picture_size(read_scene("clean"))
    message = refusal(Fussy)
    assert message.startswith("tracker mine, scene clean: cannot be constructed")
    assert f"{width}, {height} (RuntimeError: no weights at test_kit.py:" in message


def test_a_constructor_without_the_two_arguments_is_refused() -> None:
    class Simple:
        def measure(self, image, pivot_px):
            return CableAngle()

    assert "must take these two arguments" in refusal(Simple)


def test_an_exception_in_the_method_is_named_with_scene_and_frame() -> None:
    class Fragile(Blind):
        calls = 0

        def measure(self, image, pivot_px):
            self.calls += 1
            if self.calls == 3:
                raise ValueError("no\nline")
            return CableAngle()

    message = refusal(Fragile)
    assert "tracker mine, scene clean, frame 2: measure raised ValueError: no line" in message


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (None, "result None without angle_rad"),
        (0.1, "result 0.1 without angle_rad"),
        (type("Half", (), {"angle_rad": 0.1})(), "without sigma_rad"),
        (CableAngle(math.nan), "angle_rad = nan; must be finite"),
        (CableAngle(np.inf), "angle_rad = inf; must be finite"),
        (CableAngle("0.1 rad"), "angle_rad = '0.1 rad'; must be a number or None"),
        (CableAngle(0.1, math.nan), "sigma_rad = nan; must be finite"),
        (CableAngle(0.1, 0.0), "sigma_rad = 0; must be > 0"),
    ],
)
def test_a_result_that_is_no_angle_is_refused_with_scene_and_frame(result, text) -> None:
    message = refusal(answering(result))
    assert message.startswith("tracker mine, scene clean, frame 0: ")
    assert text in message


def test_a_number_of_numpy_is_an_angle() -> None:
    found = answering(CableAngle(np.float32(0.25), np.float64(0.1)))
    (result,) = kit.run(["clean"], {"mine": found}, frames=2)
    assert result.score.refused == 0


def test_no_frames_and_an_unknown_scene_are_refused() -> None:
    with pytest.raises(ConfigError, match="frames = 0; must be 1 or more"):
        kit.run(["clean"], kit.OURS, frames=0)
    with pytest.raises(ConfigError, match="clene"):
        kit.run(["clene"], kit.OURS, frames=1)


def test_a_junit_file_has_a_case_for_each_result_and_the_bars_that_failed(tmp_path) -> None:
    results = kit.run(["clean", "no_cable"], {"mine <&> :X": Careless}, frames=3)
    path = tmp_path / "junit.xml"
    write_junit(path, results)
    (suite,) = ElementTree.parse(path).getroot()
    counts = {name: suite.get(name) for name in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "2", "failures": "2", "errors": "0", "skipped": "0"}
    cases = list(suite)
    assert [case.get("name") for case in cases] == ["clean", "no_cable"]
    assert {case.get("classname") for case in cases} == {"mine <&> :X"}
    assert float(suite.get("time")) == pytest.approx(
        sum(float(case.get("time")) for case in cases), abs=1e-5
    )
    for case, result in zip(cases, results, strict=True):
        assert case.find("failure").get("message") == "; ".join(result.failures)
        assert "refused_share = 0" in case.find("system-out").text


def test_a_junit_file_of_a_tracker_that_passes_has_no_failure(tmp_path) -> None:
    path = tmp_path / "junit.xml"
    write_junit(path, kit.run(["no_cable"], {"mine": Blind}, frames=2))
    (suite,) = ElementTree.parse(path).getroot()
    assert suite.get("failures") == "0"
    assert suite[0].find("failure") is None
