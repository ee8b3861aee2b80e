"""The job of a run: what is refused before anything starts."""

from __future__ import annotations

import pytest

from rig.errors import Refused
from rig.run.config import read_experiment
from rig.run.job import Plant, prepare


def test_the_policy_source_is_refused_where_the_bench_is_not_simulated() -> None:
    chosen = read_experiment("free_decay", ["controller.policy=source", "bench.kind=external"])
    with pytest.raises(Refused, match=r"must be 'bounded' with \[bench\] kind = 'external'"):
        prepare(chosen, None, Plant(settings=None, links=1))
