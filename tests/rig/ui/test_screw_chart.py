"""Figure of diameters and leads of ball screws, read back from its artists."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from rig.drives.screw.checks import assess
from rig.drives.screw.requirements import Requirements
from rig.drives.screw.shaft import Mounting
from rig.studies.sizing.axis_file import example_tables, sizing_of
from rig.ui.plots.screw_chart import MAX_VIOLATION_NOTES, draw_region

SIZING = sizing_of(example_tables("appendix"))
AXIS, ENTRIES = SIZING.axis, tuple(SIZING.catalogue.values())


@pytest.fixture(scope="module")
def chart():
    """Function that draws an axis with the shipped catalogue; gives panel and assessments."""

    @cache
    def draw(axis=AXIS, choice=SIZING.choice, entries=ENTRIES):
        found = [assess(axis, candidate) for candidate in entries]
        figure = draw_region(axis, found, next(a for a in found if a.candidate is choice))
        return figure.axes[0], found

    return draw


def legend_of(panel):
    return [text.get_text() for text in panel.get_legend().get_texts()]


def written_on(panel):
    return "\n".join(text.get_text() for text in panel.texts)


def shaded(panel, d_mm, p_mm):
    areas = [artist for artist in panel.collections if isinstance(artist, PolyCollection)]
    return any(path.contains_point((d_mm, p_mm)) for area in areas for path in area.get_paths())


def points_of(panel, label):
    line = next(line for line in panel.lines if line.get_label() == label)
    return sorted(
        (round(float(d), 9), round(float(p), 9)) for d, p in zip(*line.get_data(), strict=True)
    )


def sizes_of(group):
    return sorted(
        (round(1e3 * a.candidate.diameter_m, 9), round(1e3 * a.candidate.lead_m, 9)) for a in group
    )


def test_the_legend_shows_the_admissible_side_of_each_limit(chart):
    requirements = Requirements(
        life_h=2e7, sag_m=5e-5, position_error_m=1e-5, angle_error_rad=1.5e-3, stiffness_n_m=4e7
    )
    panel, _ = chart(replace(AXIS, requirements=requirements))
    assert legend_of(panel)[:9] == [
        "admissible region",
        "whirling: above",
        "balls: above",
        "buckling: larger diameter",
        "life: above",
        "sag: larger diameter",
        "accuracy: below",
        "stiffness: below",
        "least admissible lead",
    ]


def test_the_shaded_region_holds_the_screws_that_keep_all_lines_and_no_other(chart):
    panel, _ = chart()
    assert shaded(panel, 25.0, 25.0)
    assert shaded(panel, 20.0, 40.0)
    assert not shaded(panel, 25.0, 20.0)  # d n
    assert not shaded(panel, 16.0, 16.0)  # whirling
    assert not shaded(panel, 4.0, 40.0)  # buckling and whirling
    capped, _ = chart(
        replace(AXIS, requirements=Requirements(position_error_m=1e-5, angle_error_rad=2e-3))
    )  # 31.4 mm
    assert shaded(capped, 25.0, 30.0)
    assert not shaded(capped, 25.0, 33.0)


def test_every_screw_is_a_mark_that_shows_its_admissibility(chart):
    panel, found = chart()
    assert points_of(panel, "not admissible") == sizes_of([a for a in found if a.broken])
    assert points_of(panel, "admissible, data missing") == sizes_of(
        [a for a in found if a.admissible]
    )
    assert points_of(panel, "assessed screw") == [(20.0, 20.0)]
    decided, all_found = chart(
        replace(AXIS, requirements=Requirements()), choice=SIZING.catalogue["25x25"]
    )
    assert points_of(decided, "admissible") == sizes_of([a for a in all_found if a.admissible])
    assert points_of(decided, "assessed screw") == [(25.0, 25.0)]
    marks = {line.get_label(): line.get_marker() for line in panel.lines}
    assert (marks["not admissible"], marks["admissible, data missing"]) == ("x", "o")


def test_the_star_is_where_the_region_begins(chart):
    panel, _ = chart()
    d, p = points_of(panel, "least admissible lead")[0]
    assert (d, p) == pytest.approx((21.7133, 18.4136), rel=1e-5)
    assert shaded(panel, d, p + 0.5)
    assert not shaded(panel, d, p - 0.5)


def test_an_empty_region_is_reported(chart):
    panel, _ = chart(
        replace(AXIS, requirements=Requirements(position_error_m=1e-5, angle_error_rad=6e-3))
    )  # 10.5 mm at most
    assert "admissible region: empty\nwithin this chart" in written_on(panel)
    assert "admissible region" not in legend_of(panel)
    assert "admissible region: empty" not in written_on(chart()[0])


def test_a_limit_off_the_chart_is_a_note_and_no_line(chart):
    soft = replace(
        AXIS,
        bearing_n_m=1e6,
        requirements=Requirements(
            stiffness_n_m=1e7, sag_m=1.0, position_error_m=1.0, angle_error_rad=1.0
        ),
    )
    panel, _ = chart(soft)
    for words in (
        "stiffness: off the chart, satisfied nowhere",
        "sag: off the chart, satisfied everywhere",
    ):
        assert words in written_on(panel)
    assert "accuracy: off the chart, satisfied everywhere" in written_on(panel)
    assert not any(text.startswith(("stiffness", "sag", "accuracy")) for text in legend_of(panel))
    long = replace(AXIS, mounting=Mounting(length_m=0.8, free_length_m=1e-3))
    assert "buckling: off the chart, satisfied everywhere" in written_on(chart(long)[0])


def test_the_names_hide_no_mark_and_no_other_name(chart):
    slow = replace(AXIS, motor=None, requirements=Requirements(lead_class="ISO 5"))
    for axis in (AXIS, slow):
        panel, found = chart(axis)
        panel.figure.draw_without_rendering()
        names = {a.candidate.name for a in found}
        boxes = [text.get_window_extent() for text in panel.texts if text.get_text() in names]
        assert len(boxes) >= 5
        pixels = panel.transData.transform(np.array(sizes_of(found)))
        assert not any(box.contains(*pixel) for box in boxes for pixel in pixels)
        assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
        assert all(panel.bbox.x0 <= box.x0 and box.x1 <= panel.bbox.x1 for box in boxes)


def test_the_violated_limits_of_a_named_screw_stand_beside_the_chart(chart):
    assert "80V hp 20x20 violates\n  speed of the unit\n  lead class" in written_on(chart()[0])


def test_violation_notes_are_limited_in_number(chart):
    weak = replace(AXIS.motor, continuous_torque_n_m=1e-3)
    entries = tuple(
        replace(SIZING.choice, name=f"no. {k}", diameter_m=0.022 + 1e-3 * k, lead_m=0.04)
        for k in range(MAX_VIOLATION_NOTES + 4)
    )
    panel, _ = chart(replace(AXIS, motor=weak), choice=entries[0], entries=entries)
    assert written_on(panel).count("violates") == MAX_VIOLATION_NOTES
    assert "and 4 more" in written_on(panel)
