"""Asking the system for a real-time place on the processor: granted to root or CAP_SYS_NICE, done without otherwise."""

from __future__ import annotations

import os
import resource

PRIORITY = 20  # of 1..99: above everything ordinary, below the kernel's own threads
RUNAWAY_US = (200_000, 400_000)  # a task that computes this long without waiting is stuck, and ended by the kernel


def take_priority() -> bool:
    """Run this thread as SCHED_FIFO, bounded by RLIMIT_RTTIME; False when the system does not allow it."""
    try:
        resource.setrlimit(resource.RLIMIT_RTTIME, RUNAWAY_US)
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except (OSError, ValueError):
        return False
    return True


def scheduling_of(pid: int) -> str:
    """`fifo`, `other` or `gone`: what a process really got."""
    try:
        policy = os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK
    except OSError:
        return "gone"
    return "fifo" if policy == os.SCHED_FIFO else "other"
