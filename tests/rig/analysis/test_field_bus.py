"""Load and rhythm of a field bus, against counts made by hand."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from comms.link import LinkCount
from comms.mcap_log import LogWriter
from comms.messages import CanMessage
from comms.records import LinkRow
from rig.analysis.field_bus import field_bus
from rig.analysis.run_log import RunLog

EXPERIMENT = {
    "camera": {"rate_hz": 0.0},
    "vision": {"average_frames": 3},
    "model": {"gravity_m_s2": 9.81, "length_m": 1.0},
    "can": {"bitrate": 500_000},
}
PLAN = {
    "planner": "zv",
    "distance_m": 0.1,
    "time_s": 1.0,
    "quiet_s": 0.0,
    "watch_s": 1.0,
    "positions_m": [[0.0, 0.0, 0.0]],
    "metrics": None,
}


def frame(seq: int, t_ms: float, can_id: int, data: bytes) -> CanMessage:
    """A data frame."""
    return CanMessage(
        seq=seq,
        t_ns=round(t_ms * 1e6),
        can_id=can_id,
        is_extended=False,
        is_remote=False,
        length=len(data),
        data=data,
    )


def logged(path: Path, frames: list[CanMessage], count: LinkCount) -> RunLog:
    """Log of a run with these frames of the master."""
    log = LogWriter(path, {"run_id": "x", "mode": "virtual", "experiment": "x"}, 0)
    for name, content in (("experiment.json", EXPERIMENT), ("plan.json", PLAN)):
        log.attach(name, "application/json", msgspec.json.encode(content))
    for message in frames:
        log.write("/can_down", message, message.t_ns, message.t_ns, message.seq)
    log.write("/link/can_down", LinkRow(channel="can_down", count=count), 0, 0)
    log.close({})
    return RunLog.open(path)


def test_load_and_period_are_those_counted_by_hand(tmp_path: Path) -> None:
    frames = []
    for k in range(11):
        shift_ms = 0.4 if k == 5 else 0.0
        frames.append(frame(2 * k, 10.0 * k + shift_ms, 0x080, b""))
        frames.append(frame(2 * k + 1, 10.0 * k, 0x201, bytes(6)))
    count = LinkCount(sent=22, delivered=22, bus_errors=3)
    found = field_bus(logged(tmp_path / "run.mcap", frames, count))
    assert found is not None
    bits = 11 * (47 + 47 + 48)
    most_bits = bits + 11 * ((34 - 1) // 4 + (34 + 48 - 1) // 4)
    assert found.load == pytest.approx(bits / (500_000 * 0.1))
    assert found.load_stuffed == pytest.approx(most_bits / (500_000 * 0.1))
    assert found.sync_period_s == pytest.approx(0.010)
    assert found.sync_jitter_s == pytest.approx(0.4e-3)
    assert (found.frames, found.errors, found.bus_off) == (22, 3, False)


def test_a_run_without_a_field_bus_has_no_figures(tmp_path: Path) -> None:
    assert field_bus(logged(tmp_path / "run.mcap", [], LinkCount())) is None
