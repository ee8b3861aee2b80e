"""Real-time scheduling of a task: granted to root or CAP_SYS_NICE, otherwise left out."""

from __future__ import annotations

import os
import resource

# RLIMIT_RTTIME, soft and hard: the kernel ends a task that computes this long without waiting
RUNAWAY_US = (1_000_000, 2_000_000)


def take_priority(priority: int, *, is_bounded: bool = True) -> bool:
    """Run this thread and those it starts as SCHED_FIFO; return False if not allowed.

    priority: 1..99; 0 leaves the scheduling unchanged. is_bounded: RLIMIT_RTTIME ends a process
    that computes too long; the bound stays until the process exits.
    """
    if priority == 0:
        return False
    try:
        if is_bounded:
            resource.setrlimit(resource.RLIMIT_RTTIME, RUNAWAY_US)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, ValueError):
        return False
    return True


def drop_priority() -> None:
    """Return this thread to ordinary scheduling."""
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def scheduling_of(pid: int) -> str:
    """Return the actual scheduling of a process: `fifo`, `other` or `gone` (exited)."""
    try:
        return "fifo" if os.sched_getscheduler(pid) == os.SCHED_FIFO else "other"
    except OSError:
        return "gone"
