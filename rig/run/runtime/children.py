"""Processes of a run: started with their settings, watched, and killed if they do not exit."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from comms.channels import VISION_TASKS
from comms.clock import cpu_of_s
from comms.ends import OPERATOR_SILENT_NS, Wiring
from comms.priority import scheduling_of
from rig.run.node_settings import NodeSettings

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


class Process(NamedTuple):
    """Row of the process table: module, requested real-time priority, and if it moves the robot.

    The order of the priorities is that of the controller in the source.
    """

    module: str
    priority: int
    is_mover: bool = False


PROCESSES = {
    "bench": Process("sim_rig", 25),
    "controller": Process("rig.run.tasks.controller", 30, is_mover=True),
    **{name: Process("vision", 10) for name in VISION_TASKS},
    "streamer": Process("rig.run.tasks.streamer", 20, is_mover=True),
    "drive": Process("rig.run.tasks.drive", 28, is_mover=True),
}
NODE_MODULE = "rig.run.runtime.drive_node"  # of the bench of a run with a drive


class Children:
    """One process per task; its output goes to <task>.log in the folder of the run."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._exited: set[str] = set()

    @property
    def names(self) -> set[str]:
        """Names of the tasks that were started."""
        return set(self._running)

    def start(self, settings: Mapping[str, Any], wiring: Wiring) -> None:
        """Start every task with the same interpreter and its settings on standard input.

        Each has a process group of its own, so that Ctrl-C reaches the operator alone. The bound on
        the silence of the operator is that of the tasks that move; the others may wait longer.
        """
        for name, task_settings in settings.items():
            process = PROCESSES[name]
            if name == "bench" and isinstance(task_settings, NodeSettings):
                process = process._replace(module=NODE_MODULE)
            with self._log_path(name).open("wb") as log:
                child = subprocess.Popen(
                    [sys.executable, "-P", "-m", process.module],
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=log,
                    env=os.environ | ONE_THREAD,
                    process_group=0,
                )
            self._running[name] = child
            silent_ns = wiring.operator_silent_ns
            if not process.is_mover:
                silent_ns = max(silent_ns, OPERATOR_SILENT_NS)
            own = msgspec.structs.replace(
                wiring, priority=process.priority, operator_silent_ns=silent_ns
            )
            data = msgspec.json.encode({"wiring": own, "settings": task_settings})
            _write_settings(child, data)

    def newly_exited(self) -> list[tuple[str, int]]:
        """List tasks that exited since the last call, with their exit codes."""
        found = []
        for name, child in self._running.items():
            code = child.poll()
            if code is not None and name not in self._exited:
                self._exited.add(name)
                found.append((name, code))
        return found

    def any_alive(self) -> bool:
        """Tell if any task still runs."""
        return any(child.poll() is None for child in self._running.values())

    def last_log_line(self, name: str) -> str:
        """Read the last line of a task's output."""
        log = self._log_path(name)
        if not log.exists():
            return "no output"
        lines = log.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "no output"

    def cpu_s(self) -> dict[str, float]:
        """Measure the processor time of each running task [s]."""
        return {
            name: cpu_of_s(child.pid)
            for name, child in self._running.items()
            if child.poll() is None
        }

    def scheduling(self) -> dict[str, str]:
        """Read the scheduling policy of each task."""
        return {name: scheduling_of(child.pid) for name, child in self._running.items()}

    def kill_running(self, only: set[str] | None = None) -> list[str]:
        """Kill tasks that still run, those in `only` if given; return their names.

        Empty output files are removed.
        """
        killed = []
        for name, child in self._running.items():
            if only is not None and name not in only:
                continue
            if child.poll() is None:
                child.kill()
                killed.append(name)
                self._exited.add(name)  # newly_exited() does not report it
            child.wait()
            if child.stdin is not None:
                with suppress(BrokenPipeError):  # it exited before it read its settings
                    child.stdin.close()
            log = self._log_path(name)
            if log.exists() and log.stat().st_size == 0:
                log.unlink()
        return killed

    def _log_path(self, name: str) -> Path:
        return self._folder / f"{name}.log"


def _write_settings(child: subprocess.Popen[bytes], data: bytes) -> None:
    """Write a line to a task's standard input, which stays open: its end is that of the operator.

    newly_exited() reports a task that exited before reading.
    """
    if child.stdin is not None:
        with suppress(BrokenPipeError):
            child.stdin.write(data + b"\n")
            child.stdin.flush()
