"""What the packages import is declared, and what they need travels with them."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PACKAGES = ("comms", "planners", "vision", "sim_rig", "rig")


def imported_by(folder):
    """Top-level names that the modules of a folder import."""
    names = set()
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
                names.add(node.module.partition(".")[0])
    return names - set(sys.stdlib_module_names) - set(PACKAGES)


def declared(requirements):
    """Normalised names of distributions in a list of requirements."""
    return {re.split(r"[\[<>=~! ]", line)[0].lower().replace("_", "-") for line in requirements}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_distribution_that_a_package_imports_is_declared(package):
    known = packages_distributions()
    needed = {known[name][0].lower().replace("_", "-") for name in imported_by(package)}
    extras = PROJECT["optional-dependencies"]
    optional = [*extras["parquet"], *extras["formats"]]  # imported where they are asked for
    assert needed <= declared([*PROJECT["dependencies"], *optional])


@pytest.mark.parametrize("package", PACKAGES)
def test_every_package_says_that_it_is_typed(package):
    assert (ROOT / package / "py.typed").is_file()


@pytest.mark.parametrize("package", PACKAGES)
def test_every_room_says_in_its_first_lines_what_it_may_import(package):
    rooms = list((ROOT / package).rglob("__init__.py"))
    silent = [
        str(path.relative_to(ROOT))
        for path in rooms
        if "mport" not in "\n".join(path.read_text().splitlines()[:10])
    ]
    assert silent == []


def test_no_module_is_longer_than_300_lines():
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text().splitlines())
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
    }
    assert {name: lines for name, lines in lengths.items() if lines > 300} == {}
