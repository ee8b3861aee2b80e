"""Faults of pictures in a stream: repetitions, damage, cuts, loops; and what is none."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from rig.studies.vision.scene import read_scene, scene_frames
from tests.vision.recordings import Picture, swing
from vision.stream import FindingKind, PictureFault, SourceFrame, StampKind, StreamFinding
from vision.stream_check import checked

DAMAGED, DUPLICATE, FROZEN = PictureFault.DAMAGED, PictureFault.DUPLICATE, PictureFault.FROZEN


def check(
    pictures: Sequence[Picture], keeps_noise: bool = True
) -> tuple[dict[int, frozenset[PictureFault]], list[StreamFinding]]:
    """Check pictures at 50 Hz; returns the faults of the frames that have some."""
    findings: list[StreamFinding] = []
    frames = [
        SourceFrame(index, index / 50.0, StampKind.CONTAINER, picture)
        for index, picture in enumerate(pictures)
    ]
    passed = list(checked(iter(frames), findings, keeps_noise))
    assert [frame.number for frame in passed] == list(range(len(pictures)))
    return {frame.number: frame.faults for frame in passed if frame.faults}, findings


def places(findings: list[StreamFinding], kind: FindingKind) -> list[tuple[int, int]]:
    return [(finding.first, finding.last) for finding in findings if finding.kind is kind]


@pytest.mark.parametrize("noise", [0.7, 2.5, 10.0])
def test_a_good_stream_has_neither_faults_nor_findings(noise: float) -> None:
    assert check(swing(90, noise)) == ({}, [])


@pytest.mark.parametrize(
    ("scene", "fault", "none"),
    [
        ("damaged_frames", "damaged", "0"),
        ("duplicated_frames", "duplicated", "0"),
        ("frozen", "frozen", "[]"),
    ],
)
def test_every_faulty_frame_of_a_scene_is_found_and_no_other(
    scene: str, fault: str, none: str
) -> None:
    """The truth: the frames that differ from those of the same camera without the fault."""
    count = 160
    faulty = [f.picture for f in scene_frames(read_scene(scene), count)]
    perfect = read_scene(scene, [f"bench.camera.faults.{fault}={none}"])
    pairs = zip(faulty, scene_frames(perfect, count), strict=True)
    true = {index for index, (seen, good) in enumerate(pairs) if np.any(seen != good.picture)}
    assert len(true) > 8
    assert set(check(faulty)[0]) == true


def test_a_picture_shown_twice_is_a_duplicate_and_three_times_frozen() -> None:
    pictures = swing(40)
    shown = [*pictures[:20], pictures[19], *pictures[20:30], pictures[29], pictures[29]]
    faults, findings = check([*shown, *pictures[30:]])
    assert faults == {20: {DUPLICATE}, 31: {FROZEN}, 32: {FROZEN}}
    assert places(findings, FindingKind.DUPLICATE) == [(20, 20)]
    assert places(findings, FindingKind.FROZEN) == [(31, 32)]


def test_a_duplicate_that_was_converted_again_is_found() -> None:
    pictures = swing(40)
    again = cv2.cvtColor(cv2.cvtColor(pictures[19], cv2.COLOR_BGR2YCrCb), cv2.COLOR_YCrCb2BGR)
    assert 0.1 < cv2.absdiff(again, pictures[19]).mean() < 0.7
    faults, _ = check([*pictures[:20], np.asarray(again, np.uint8), *pictures[20:]])
    assert faults == {20: {DUPLICATE}}


def test_regular_duplicates_are_a_pulldown() -> None:
    shown: list[Picture] = []
    for index, picture in enumerate(swing(48)):
        shown.append(picture)
        if index % 4 == 3:
            shown.append(picture)
    faults, findings = check(shown)
    assert sorted(faults) == list(range(4, 60, 5))
    (pulldown,) = [f for f in findings if f.kind is FindingKind.PULLDOWN]
    assert pulldown.value == 5.0


def test_a_codec_without_noise_gives_equal_pictures_of_a_load_at_rest() -> None:
    still = swing(1, 0.0) * 30
    assert check(still, keeps_noise=False) == ({}, [])
    moving = swing(40, 0.0, first=15.0)
    faults, _ = check([*moving[:11], moving[10], moving[10], *moving[13:]], keeps_noise=False)
    assert faults == {11: {FROZEN}, 12: {FROZEN}}


def with_garbage(picture: Picture, first: int, last: int, seed: int) -> Picture:
    """Replace rows by what a decoder makes of wrong bits."""
    spoilt = picture.copy()
    shape = spoilt[first:last].shape
    spoilt[first:last] = np.random.default_rng(seed).integers(0, 256, shape)
    return spoilt


def test_garbage_is_damaged_from_the_first_to_the_last_of_its_frames() -> None:
    pictures = swing(50)
    for index in (0, 1, 2, 20, *range(30, 42), 49):
        pictures[index] = with_garbage(pictures[index], 60 + index, 100 + index, index)
    faults, findings = check(pictures)
    assert set(faults) == {0, 1, 2, 20, *range(30, 42), 49}
    assert set(faults.values()) == {frozenset({DAMAGED})}
    runs = places(findings, FindingKind.DAMAGED)
    assert runs == [(0, 2), (20, 20), (30, 41), (49, 49)]


def test_a_single_row_of_garbage_is_found() -> None:
    pictures = swing(30)
    pictures[15] = with_garbage(pictures[15], 100, 101, 5)
    assert check(pictures)[0] == {15: {DAMAGED}}


def test_a_file_of_garbage_alone_is_damaged_in_every_frame() -> None:
    pictures = [with_garbage(picture, 0, 240, i) for i, picture in enumerate(swing(20))]
    assert set(check(pictures)[0]) == set(range(20))


def test_a_repeated_damaged_picture_is_damaged_too() -> None:
    pictures = swing(30)
    pictures[15] = with_garbage(pictures[15], 50, 90, 5)
    pictures[16] = pictures[15]
    faults, _ = check(pictures)
    assert faults == {15: {DAMAGED}, 16: {DAMAGED, DUPLICATE}}


@pytest.mark.parametrize("light", [0.6, 1.25])
def test_steps_and_flicker_of_the_light_are_no_damage(light: float) -> None:
    pictures = swing(60)
    levels = np.ones(60)
    levels[20:40] = light
    levels[45:60:2] = light
    lit = [
        np.clip(picture * level, 0, 255).astype(np.uint8)
        for picture, level in zip(pictures, levels, strict=True)
    ]
    assert check(lit) == ({}, [])


def test_a_jump_of_the_cable_is_a_cut() -> None:
    before = swing(12, first=80.0, period=400.0)
    after = swing(12, first=250.0, seed=2, period=400.0)
    faults, findings = check([*before, *after])
    assert faults == {}
    assert places(findings, FindingKind.CUT) == [(12, 12)]


def test_another_scene_is_a_cut() -> None:
    pictures = swing(40)
    board = np.kron(np.indices((12, 16)).sum(axis=0) % 2, np.ones((20, 20)))[..., None] * 150.0
    random = np.random.default_rng(4)
    for index in range(20, 40):
        noisy = board + 30.0 + random.normal(0.0, 2.5, (240, 320, 3))
        pictures[index] = np.clip(noisy, 0, 255).astype(np.uint8)
    faults, findings = check(pictures)
    assert faults == {}
    assert places(findings, FindingKind.CUT) == [(20, 20)]


def test_a_recording_that_begins_again_is_a_loop() -> None:
    pictures = swing(33)
    faults, findings = check([*pictures, *pictures])
    assert faults == {}
    assert places(findings, FindingKind.LOOP) == [(33, 33)]


def test_a_periodic_swing_is_no_loop() -> None:
    assert check(swing(120))[1] == []
