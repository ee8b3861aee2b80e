"""Colours and axes style are defined once, in rig/ui/plots/style.py."""

import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from rig.ui.plots import style

MODULES = sorted(Path(style.__file__).parent.glob("*.py"))
COLOUR = re.compile(r"#[0-9a-fA-F]{3,8}\b")


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.stem)
def test_a_figure_module_defines_no_colour_of_its_own(module):
    found = COLOUR.findall(module.read_text())
    assert bool(found) == (module.name == "style.py")


def test_the_colours_of_a_series_are_distinct():
    for series in (style.SERIES, style.SERIES_WITHOUT_RED):
        assert len(set(series)) == len(series)
    assert style.RED not in style.SERIES_WITHOUT_RED


def test_labels_are_set_only_when_given_and_the_zero_line_only_on_request():
    panel = Figure().subplots()
    panel.set_xlabel("time [s]")
    style.style_axes(panel, ylabel="speed [m/s]")
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("time [s]", "speed [m/s]")
    assert len(panel.lines) == 0
    assert not panel.spines["top"].get_visible()
    style.style_axes(panel, zero_line=True)
    assert panel.lines[0].get_ydata() == [0.0, 0.0]
    assert panel.get_ylabel() == "speed [m/s]"
