"""Asking the system for a real-time place on the processor: granted to root or CAP_SYS_NICE, done without otherwise."""

from __future__ import annotations

import os
import resource

RUNAWAY_US = (
    1_000_000,
    2_000_000,
)  # a task that computes this long without waiting is stuck, and ended by the kernel


def take_priority(priority: int) -> bool:
    """Run this thread and those it starts as SCHED_FIFO (1..99), bounded by RLIMIT_RTTIME; False when not allowed.

    0 asks for nothing.
    """
    if priority == 0:
        return False
    try:
        resource.setrlimit(resource.RLIMIT_RTTIME, RUNAWAY_US)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, ValueError):
        return False
    return True


def scheduling_of(pid: int) -> str:
    """`fifo`, `other` or `gone`: what a process really got."""
    try:
        return "fifo" if os.sched_getscheduler(pid) == os.SCHED_FIFO else "other"
    except OSError:
        return "gone"
