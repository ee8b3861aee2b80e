"""Process of the simulated bench."""

import sys

import msgspec

from comms.runner import main
from sim_rig.params import BenchParams
from sim_rig.task import BenchTask


def build(settings: bytes) -> BenchTask:
    """Create the task from its settings in JSON."""
    return BenchTask(msgspec.json.decode(settings, type=BenchParams))


sys.exit(main(build))
