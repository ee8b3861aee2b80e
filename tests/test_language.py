"""Every docstring begins with the thing or the action, on one line; class names are unique."""

import ast
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("comms", "planners", "vision", "sim_rig", "rig")
CLAUSES = {"What", "Of", "How", "Whether", "Where", "Which", "When", "Who", "Whose", "Why"}
PREPOSITIONS = {"About", "As", "At", "Behind", "Beside", "By", "For", "From", "In", "On", "To"}
DEFINITIONS = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.Module)


def trees():
    """Path and syntax tree of every module of the product."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT), ast.parse(path.read_text())


def docstrings():
    """Place and first line of every docstring."""
    for path, tree in trees():
        for node in ast.walk(tree):
            if isinstance(node, DEFINITIONS) and ast.get_docstring(node):
                name = getattr(node, "name", "module")
                yield f"{path}:{name}", ast.get_docstring(node).splitlines()[0]


def test_no_docstring_begins_with_a_clause_or_a_preposition():
    wrong = CLAUSES | PREPOSITIONS
    found = [f"{place}: {line}" for place, line in docstrings() if line.split()[0] in wrong]
    assert found == []


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_definition_has_a_docstring(package):
    silent = [
        f"{path}:{node.name}"
        for path, tree in trees()
        if path.parts[0] == package
        for node in tree.body
        if isinstance(node, DEFINITIONS)
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]
    assert silent == []


def test_a_public_class_name_stands_once_in_the_product():
    names = Counter(
        node.name
        for _, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in names.items() if count > 1] == []
