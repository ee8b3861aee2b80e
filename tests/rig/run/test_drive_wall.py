"""Master and node as processes on a simulated bus. No duration is asserted."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from comms.can_bus import has_multicast
from comms.messages import CanMessage, Truth
from rig.analysis.run_log import RunLog
from rig.run import config, experiment
from rig.run.runs import LOG
from rig.run.tasks.operator import Operator
from tests.rig.run.test_wall_loop import PATIENT, quietly

pytestmark = pytest.mark.xdist_group("wall")  # one rig at a time: five processes each
BRIEF = [
    "bench.robot.kind=ball_screw",
    "bench.pendulum.length_m=1",
    "camera.rate_hz=0",
    "experiment.quiet_s=0.2",
    "experiment.watch_s=0.3",
    "move.distance_m=0.1",
    "move.time_s=1.2",
    "drive.heartbeat_ms=400",
    *PATIENT,
]
SYNC, RPDO, TPDO, BEAT_OF_MASTER, BEAT_OF_NODE = 0x080, 0x201, 0x181, 0x77F, 0x701


def counts(log: RunLog, channel: str) -> dict[int, int]:
    """Number of frames sent on a channel, by identifier."""
    ids = [message.can_id for message in log.log.read(f"/{channel}", CanMessage)]
    return {can_id: ids.count(can_id) for can_id in set(ids)}


@pytest.mark.parametrize("interface", ["swayless_udp", "udp_multicast"])
def test_a_move_over_the_bus_ends_well_and_every_frame_is_accounted_for(
    tmp_path: Path, interface: str
) -> None:
    if interface == "udp_multicast" and not has_multicast(47_311):
        pytest.skip("udp_multicast: no multicast between two sockets of this machine")
    changes = [*BRIEF, f"can.interface={interface}"]
    ran = experiment.run(
        config.read_experiment("move", changes), "wall", tmp_path, quietly, quietly
    )
    log = RunLog.open(ran.folder / LOG)
    assert (ran.outcome.exit_code, ran.outcome.reasons) == (0, [])
    rows = log.links()
    for name in ("can_down", "can_up", "setpoint", "joint_state"):
        assert rows[name].count.unaccounted == 0, name
        assert rows[name].count.foreign == 0, name
    down, up = counts(log, "can_down"), counts(log, "can_up")
    assert down[RPDO] > 200
    assert abs(down[SYNC] - down[RPDO]) <= 1
    assert 0 <= down[SYNC] - up[TPDO] <= 40  # the bench closes before the master
    assert down[BEAT_OF_MASTER] > 3
    assert up[BEAT_OF_NODE] > 3
    truth = log.log.read("/truth", Truth)
    assert truth[-1].position_m[0] == pytest.approx(0.1, abs=2e-5)


def test_a_killed_master_leaves_the_axis_at_rest_and_the_run_as_a_fault(tmp_path: Path) -> None:
    killed: list[int] = []

    def kill_in_motion(t_ns: int, operator: Operator) -> None:
        if killed or operator.t_start_ns is None or t_ns < operator.t_start_ns + 800_000_000:
            return
        killed.append(child_of(os.getpid(), "rig.run.tasks.drive"))
        os.kill(killed[0], signal.SIGKILL)

    read = config.read_experiment("move", BRIEF)
    ran = experiment.run(read, "wall", tmp_path, kill_in_motion, quietly)
    assert ran.outcome.exit_code == 5
    assert "task 'drive' exited during the run (signal 9)" in "\n".join(ran.outcome.reasons)
    log = RunLog.open(ran.folder / LOG)
    speeds = np.array([truth.velocity_m_s[0] for truth in log.log.read("/truth", Truth)])
    assert np.abs(speeds).max() > 0.05
    assert np.abs(speeds[-5:]).max() < 1e-4
    positions = [truth.position_m[0] for truth in log.log.read("/truth", Truth)]
    assert -0.25 < min(positions) <= max(positions) < 0.25


def child_of(parent: int, module: str) -> int:
    """The process that runs a task of this run."""
    for children in Path(f"/proc/{parent}/task").glob("*/children"):
        for pid in children.read_text().split():
            if Path(f"/proc/{pid}/cmdline").read_bytes().endswith(f"{module}\0".encode()):
                return int(pid)
    raise AssertionError(f"no process of {module}")
