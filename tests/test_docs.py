"""The pages are held to the code."""

import re
from pathlib import Path

import pytest

from comms import wire_page
from planners.catalog import PLANNERS
from rig.ui.cli.verbs import VERBS

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "README.md",
    "docs/path.md",
    "docs/planning.md",
    "docs/motions.md",
    "docs/drives.md",
    "docs/vision.md",
    "docs/scenes.md",
    "docs/wire.md",
    "docs/sources.md",
    "docs/glossary.md",
    "docs/decisions/2026-11-29-the-house.md",
)


def test_the_wire_page_is_the_one_the_channel_table_makes():
    told = (ROOT / "docs/wire.md").read_text()
    assert told == wire_page.page(), "run: python -m comms.wire_page > docs/wire.md"


@pytest.mark.parametrize("page", PAGES)
def test_every_link_of_a_page_leads_somewhere(page):
    here = (ROOT / page).parent
    links = re.findall(r"\]\(([^)]+)\)", (ROOT / page).read_text())
    assert [link for link in links if not (here / link).exists()] == []


def test_every_command_of_the_readme_is_one_of_the_program():
    verbs = set(VERBS)
    named = set(re.findall(r"`rig ([a-z][a-z-]*)", (ROOT / "README.md").read_text()))
    assert named <= verbs
    assert verbs - {"calibrate"} <= named


def test_the_python_of_the_readme_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(PLANNERS)
    assert all(0.005 < float(line.split()[1]) < 0.05 for line in lines)


def test_every_make_target_of_the_readme_exists():
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"`?make ([a-z]+)", (ROOT / "README.md").read_text())) <= targets
