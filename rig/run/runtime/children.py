"""The processes of a run: started with what they are told, watched, and never left behind."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from comms.clock import cpu_of_s
from comms.ends import Wiring
from comms.priority import scheduling_of

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


class Process(NamedTuple):
    """One row of the table: what is run, and the real-time priority asked for, ordered as in the source's controller."""

    module: str
    priority: int


PROCESSES = {
    "bench": Process("sim_rig", 25),
    "controller": Process("rig.run.tasks.controller", 30),
    "vision": Process("vision", 10),
    "streamer": Process("rig.run.tasks.streamer", 20),
}


class Children:
    """One process a task; each writes what it has to say to <task>.log in the run's folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._dead: set[str] = set()

    @property
    def names(self) -> set[str]:
        """Tasks that were started."""
        return set(self._running)

    def start(self, settings: Mapping[str, Any], wiring: Wiring) -> None:
        """Start every task: same interpreter, settings on standard input, a process group of its own (Ctrl-C is ours)."""
        for name, told in settings.items():
            process = PROCESSES[name]
            with (self._folder / f"{name}.log").open("wb") as words:
                child = subprocess.Popen(
                    [sys.executable, "-P", "-m", process.module],
                    stdin=subprocess.PIPE,
                    stdout=words,
                    stderr=words,
                    env=os.environ | ONE_THREAD,
                    process_group=0,
                )
            self._running[name] = child
            own = msgspec.structs.replace(wiring, priority=process.priority)
            _tell(child, msgspec.json.encode({"wiring": own, "settings": told}))

    def newly_dead(self) -> list[tuple[str, int]]:
        """Tasks that ended since the last look, with their exit codes."""
        found = []
        for name, child in self._running.items():
            code = child.poll()
            if code is not None and name not in self._dead:
                self._dead.add(name)
                found.append((name, code))
        return found

    def any_alive(self) -> bool:
        """Whether any task still runs."""
        return any(child.poll() is None for child in self._running.values())

    def last_words(self, name: str) -> str:
        """The last line a task wrote."""
        words = self._folder / f"{name}.log"
        lines = words.read_text(errors="replace").strip().splitlines() if words.exists() else []
        return lines[-1] if lines else "it said nothing"

    def cpu_s(self) -> dict[str, float]:
        """Processor seconds of each running task."""
        return {
            name: cpu_of_s(child.pid)
            for name, child in self._running.items()
            if child.poll() is None
        }

    def scheduling(self) -> dict[str, str]:
        """What each task got of the real-time place it asked for."""
        return {name: scheduling_of(child.pid) for name, child in self._running.items()}

    def end(self, only: set[str] | None = None) -> list[str]:
        """Kill those of ours that did not leave by themselves; returns their names."""
        killed = []
        for name, child in self._running.items():
            if only is not None and name not in only:
                continue
            if child.poll() is None:
                child.kill()
                killed.append(name)
                self._dead.add(name)  # no news to anybody
            child.wait()
            words = self._folder / f"{name}.log"
            if words.exists() and words.stat().st_size == 0:
                words.unlink()
        return killed


def _tell(child: subprocess.Popen[bytes], words: bytes) -> None:
    """Standard input of a task; one that died before reading is found dead at the next look."""
    if child.stdin is not None:
        try:
            child.stdin.write(words)
            child.stdin.close()
        except BrokenPipeError:
            return
