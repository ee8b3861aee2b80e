"""View of a picture: the pixel that a place names, planes, polarity and size."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vision.view import PLANES, PictureRegion, PictureView, is_grey, plane_of

WIDTH, HEIGHT = 23, 17
SIZE = (WIDTH, HEIGHT)


@st.composite
def views(draw: st.DrawFn) -> PictureView:
    """Views of a picture of SIZE, of any region and turn."""
    x = draw(st.integers(0, WIDTH - 1))
    y = draw(st.integers(0, HEIGHT - 1))
    width = draw(st.integers(1, WIDTH - x))
    height = draw(st.integers(1, HEIGHT - y))
    region = draw(st.sampled_from([None, PictureRegion(x, y, width, height)]))
    return PictureView("grey", draw(st.booleans()), draw(st.integers(0, 3)), region)


@given(view=views(), data=st.data())
def test_a_place_names_the_same_pixel_in_picture_and_view(
    view: PictureView, data: st.DataObject
) -> None:
    x0, y0, width, height = view.region or PictureRegion(0, 0, WIDTH, HEIGHT)
    x = data.draw(st.integers(x0, x0 + width - 1))
    y = data.draw(st.integers(y0, y0 + height - 1))
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    image[y, x] = 255
    seen = view.picture(image)
    marked = 0 if view.is_bright else 255
    (row,), (column,) = np.nonzero(seen == marked)
    assert view.to_view((x, y), SIZE) == (column, row)
    assert view.to_picture((float(column), float(row)), SIZE) == (x, y)


@given(view=views(), x=st.floats(-500.0, 500.0), y=st.floats(-500.0, 500.0))
def test_a_place_outside_the_picture_survives_the_way_to_the_view_and_back(
    view: PictureView, x: float, y: float
) -> None:
    back = view.to_picture(view.to_view((x, y), SIZE), SIZE)
    assert back == pytest.approx((x, y), abs=1e-9)


@given(view=views())
def test_a_view_has_the_size_that_it_states_and_is_contiguous(view: PictureView) -> None:
    seen = view.picture(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    assert seen.shape[::-1] == view.size(*SIZE)
    assert seen.flags.c_contiguous


def test_a_turn_is_counterclockwise() -> None:
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    image[:, -1] = 200  # the right border
    assert (PictureView(turns=1).picture(image)[0] == 200).all()  # comes to the top


def test_a_bright_cable_becomes_dark() -> None:
    image = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH), np.uint8)
    assert (PictureView(is_bright=True).picture(image) == 255 - image).all()


@pytest.mark.parametrize(("plane", "channel"), [("blue", 0), ("green", 1), ("red", 2)])
def test_a_colour_plane_is_the_channel_of_that_name(plane: str, channel: int) -> None:
    image = np.random.default_rng(2).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    assert (plane_of(image, plane) == image[:, :, channel]).all()
    assert (PictureView(plane).picture(image) == image[:, :, channel]).all()


def test_grey_is_the_luma_of_the_colours() -> None:
    image = np.random.default_rng(3).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    luma = image.astype(float) @ [0.114, 0.587, 0.299]  # ITU-R BT.601
    assert np.abs(plane_of(image, "grey") - luma).max() <= 1.0


@pytest.mark.parametrize("plane", PLANES)
def test_a_picture_with_one_plane_is_every_plane(plane: str) -> None:
    image = np.random.default_rng(4).integers(0, 256, (HEIGHT, WIDTH), np.uint8)
    assert (plane_of(image, plane) == image).all()


def test_a_picture_is_grey_if_its_planes_are_equal() -> None:
    one = np.random.default_rng(5).integers(0, 200, (160, 200), np.uint8)
    assert is_grey(one)
    three = np.stack([one] * 3, axis=2)
    assert is_grey(three)
    for channel in range(3):
        tinted = three.copy()
        tinted[:, 90:110, channel] += 9
        assert not is_grey(tinted)
