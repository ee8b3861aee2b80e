"""Sizing file: old names of its tables."""

from __future__ import annotations

import pytest

from planners.errors import PlanError
from rig.errors import ConfigError, RenamedKey
from rig.studies.sizing.axis_file import RENAMED_TABLES, example_tables, sizing_of


def tables_with_old_names(*old_names):
    tables = example_tables("appendix")
    for old in old_names:
        tables[old] = tables.pop(RENAMED_TABLES[old])
    return tables


@pytest.mark.parametrize(("old", "new"), RENAMED_TABLES.items())
def test_a_table_of_an_old_name_is_read_with_a_warning_that_names_the_new_one(old, new):
    tables = tables_with_old_names(old)
    with pytest.warns(RenamedKey, match=rf"\[{old}\] is now called \[{new}\]"):
        sizing = sizing_of(tables)
    assert sizing.axis == sizing_of(example_tables("appendix")).axis
    assert old in tables  # the caller's tables are unchanged


def test_a_table_under_both_names_is_refused():
    tables = tables_with_old_names("wishes")
    tables["requirements"] = {"life_h": 1000.0}
    with pytest.raises(ConfigError, match=r"\[wishes\] and \[requirements\] are the same table"):
        sizing_of(tables)


def test_a_value_out_of_bounds_in_a_table_of_an_old_name_is_refused_under_the_new_one():
    tables = tables_with_old_names("shares")
    tables["shares"]["whirl"] = 2.0
    with (
        pytest.warns(RenamedKey, match=r"\[shares\]"),
        pytest.raises(PlanError, match=r"\[utilisation\] whirl = 2\.0; must be 0\.01 to 1"),
    ):
        sizing_of(tables)
