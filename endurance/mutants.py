"""Mutants of a source file: one small change at a time, each to be noticed by a test.

Usage: `python -m endurance.mutants FILE [--shard K/N] [--only LINE]`. The tests beside the file run
first, those of its room for what survives them. Prints each survivor with its change; a survivor is
killed by a new test, or explained in endurance/survivors.md. Ends with exit code 1 where one is
left that is not listed there.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.machinery
import importlib.util
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
LISTED = Path(__file__).with_name("survivors.md")
TIMEOUT_S = 120
CONTROLLER = ["tests/rig/run/test_controller.py", "tests/rig/run/test_path.py"]
NEAR: dict[str, list[str]] = {
    "rig/run/tasks/safety.py": ["tests/rig/run/test_safety.py", "tests/rig/run/test_job.py"],
    "rig/run/tasks/controller/phase.py": ["tests/rig/run/test_phase.py"],
    "rig/run/tasks/controller/interpolator.py": ["tests/rig/run/test_interpolator.py"],
    "rig/run/tasks/controller/communication.py": CONTROLLER,
    "rig/run/tasks/controller/task.py": [
        *CONTROLLER,
        "tests/rig/run/test_setpoint_gate.py",
        "tests/rig/run/test_following.py",
    ],
    "rig/run/tasks/streamer.py": ["tests/rig/run/test_streamer.py"],
    "comms/codec.py": ["tests/comms/test_codec.py", "tests/comms/test_wire_gate.py"],
    "comms/link.py": ["tests/comms/test_link.py", "tests/comms/test_wire_gate.py"],
    "comms/ends.py": ["tests/comms/test_wire_gate.py", "tests/comms/test_ends.py"],
}
WIDE = {
    "comms": ["tests/comms", "tests/rig/run/test_path.py", "tests/rig/run/test_wall_loop.py"],
    "rig": ["tests/rig/run", "tests/rig/analysis"],
}
OPERATORS: dict[type[ast.AST], list[type[ast.AST]]] = {
    ast.Lt: [ast.LtE, ast.GtE],
    ast.LtE: [ast.Lt, ast.Gt],
    ast.Gt: [ast.GtE, ast.LtE],
    ast.GtE: [ast.Gt, ast.Lt],
    ast.Eq: [ast.NotEq],
    ast.NotEq: [ast.Eq],
    ast.Is: [ast.IsNot],
    ast.IsNot: [ast.Is],
    ast.In: [ast.NotIn],
    ast.NotIn: [ast.In],
    ast.Add: [ast.Sub],
    ast.Sub: [ast.Add],
    ast.Mult: [ast.FloorDiv],
    ast.Div: [ast.Mult],
    ast.FloorDiv: [ast.Mult],
    ast.Mod: [ast.Mult],
    ast.LShift: [ast.RShift],
    ast.RShift: [ast.LShift],
    ast.BitAnd: [ast.BitOr],
    ast.BitOr: [ast.BitAnd],
    ast.BitXor: [ast.BitOr],
    ast.And: [ast.Or],
    ast.Or: [ast.And],
}


class Mutant(NamedTuple):
    """A changed module and what was changed."""

    line: int
    change: str
    tree: ast.Module


def mutants(source: str) -> Iterator[Mutant]:
    """Make every mutant of a module; docstrings, annotations and imports stay as they are."""
    tree = ast.parse(source)
    count = sum(1 for _ in _points(tree))
    for place in range(count):
        for k in range(_variants(_at(tree, place))):
            changed = copy.deepcopy(tree)
            node = _at(changed, place)
            before = ast.unparse(node)
            line = getattr(node, "lineno", 0)
            replacement = _mutate(node, k)
            if replacement is not node:
                _Replace(node, replacement).visit(changed)
            after = ast.unparse(replacement)
            yield Mutant(line, f"{before} -> {after}", ast.fix_missing_locations(changed))


class _Replace(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._old else self.generic_visit(node)


def _at(tree: ast.Module, place: int) -> ast.AST:
    return next(node for k, node in enumerate(_points(tree)) if k == place)


def _points(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that can be mutated, in a fixed order."""
    if _variants(node):
        yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases", "keywords_of_class"):
            continue
        children = value if isinstance(value, list) else [value]
        for child in children:
            if isinstance(child, ast.AST) and not _is_left_out(child):
                yield from _points(child)


def _is_left_out(node: ast.AST) -> bool:
    is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return is_text or isinstance(node, ast.Import | ast.ImportFrom | ast.JoinedStr | ast.Raise)


def _variants(node: ast.AST) -> int:
    """Number of mutants of a node itself."""
    if isinstance(node, ast.Compare):
        return len(OPERATORS.get(type(node.ops[0]), ()))
    if isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign):
        return len(OPERATORS.get(type(node.op), ()))
    if isinstance(node, ast.UnaryOp):
        return int(isinstance(node.op, ast.Not | ast.USub))
    if isinstance(node, ast.Constant):
        return int(isinstance(node.value, bool | int | float))
    return 0


def _mutate(node: ast.AST, k: int) -> ast.AST:
    if isinstance(node, ast.Compare):
        node.ops[0] = OPERATORS[type(node.ops[0])][k]()  # type: ignore[call-overload]
    elif isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign):
        node.op = OPERATORS[type(node.op)][k]()  # type: ignore[assignment]
    elif isinstance(node, ast.UnaryOp):
        return node.operand
    elif isinstance(node, ast.Constant):
        node.value = not node.value if isinstance(node.value, bool) else node.value + 1
    return node


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Import hook that gives the mutated module in place of the file."""

    def __init__(self, name: str, mutant: Mutant, path: Path) -> None:
        self._name, self._mutant, self._path = name, mutant, path

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name != self._name:
            return None
        return importlib.util.spec_from_file_location(name, self._path, loader=self)

    def exec_module(self, module: ModuleType) -> None:
        exec(compile(self._mutant.tree, str(self._path), "exec"), module.__dict__)


def is_killed(mutant: Mutant, path: Path, tests: Sequence[str]) -> bool:
    """Run tests in a fork of this process with the mutant in place of the module."""
    sys.stdout.flush()
    pid = os.fork()
    if pid == 0:
        os.setpgid(0, 0)
        _run_tests(mutant, path, tests)
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status) != 0
        time.sleep(0.02)
    os.killpg(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return True  # it hangs


def _run_tests(mutant: Mutant, path: Path, tests: Sequence[str]) -> None:
    import pytest

    module = str(path.relative_to(ROOT).with_suffix("")).replace("/", ".")
    sys.meta_path.insert(0, _Finder(module, mutant, path))
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, 1)
    os.dup2(sink, 2)
    code = 1
    try:
        code = pytest.main([*tests, "-x", "-p", "no:randomly", "-p", "no:cacheprovider"])
    finally:
        os._exit(int(code != 0))


def main() -> int:
    """Run the mutants of a file; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file")
    parser.add_argument("--shard", default="1/1", help="K/N: every N-th mutant from the K-th on")
    parser.add_argument("--only", type=int, help="line whose mutants are tried")
    chosen = parser.parse_args()
    path = (ROOT / chosen.file).resolve()
    name = str(path.relative_to(ROOT))
    k, n = (int(part) for part in chosen.shard.split("/"))
    os.environ["CI"] = "1"  # hypothesis: the same examples each time
    os.chdir(ROOT)
    listed = LISTED.read_text() if LISTED.exists() else ""
    near = [test for test in NEAR.get(name, []) if Path(test).exists()]
    wide = WIDE[name.split("/")[0]]
    _warm_up()
    tried = killed = 0
    left = []
    for number, mutant in enumerate(mutants(path.read_text())):
        if number % n != k - 1 or (chosen.only and mutant.line != chosen.only):
            continue
        tried += 1
        if (near and is_killed(mutant, path, near)) or is_killed(mutant, path, wide):
            killed += 1
            continue
        entry = f"{name}: `{mutant.change}`"
        is_explained = entry in listed
        print(f"{name}:{mutant.line} {mutant.change}{' (explained)' * is_explained}", flush=True)
        if not is_explained:
            left.append(entry)
    print(f"{name}: {killed} of {tried} killed, {len(left)} to explain", flush=True)
    return 1 if left else 0


def _warm_up() -> None:
    """Import the libraries once; each fork has them then."""
    import hypothesis.strategies
    import mcap.reader
    import msgspec
    import numpy
    import pytest
    import zmq

    del hypothesis, mcap, msgspec, numpy, pytest, zmq


if __name__ == "__main__":
    sys.exit(main())
