"""Medians of repeated calls, and the speed of the interpreter beside them.

Machines differ and share their cores: read ratios within one run. `--short` on the command line of
a benchmark cuts repeats and problems, to show that it runs.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable

from comms.clock import stopwatch_s

SHORT_REPEATS = 2


def is_short() -> bool:
    """Tell whether the benchmark was started with --short."""
    return "--short" in sys.argv[1:]


def timed_s(call: Callable[[], object]) -> float:
    """Wall time of one call [s]."""
    began = stopwatch_s()
    call()
    return stopwatch_s() - began


def median_s(call: Callable[[], object], repeats: int) -> float:
    """Median wall time of repeated calls [s]."""
    count = min(repeats, SHORT_REPEATS) if is_short() else repeats
    return statistics.median(timed_s(call) for _ in range(count))


def interpreter_line() -> str:
    """Time of a fixed piece of pure Python, for comparisons between machines."""
    return (
        f"interpreter: sum(range(1000)) in {median_s(lambda: sum(range(1000)), 500) * 1e6:.1f} us"
    )
