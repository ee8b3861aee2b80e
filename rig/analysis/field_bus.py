"""Load, errors and rhythm of the field bus of a run, from its log."""

from __future__ import annotations

import msgspec
import numpy as np

from comms.can_bits import frame_bits
from comms.messages import CanMessage
from rig.analysis.run_log import RunLog
from rig.analysis.summary import FieldBus

SYNC_ID = 0x080
DEFAULT_BITRATE = 1_000_000
CHANNELS = ("can_down", "can_up")


def field_bus(run: RunLog) -> FieldBus | None:
    """Compute the figures; None for a run without a field bus."""
    frames = [f for name in CHANNELS for f in run.log.read(f"/{name}", CanMessage)]
    if not frames:
        return None
    t_s = np.array([f.t_ns for f in frames]) * 1e-9
    duration_s = float(t_s.max() - t_s.min())
    lengths = [frame_bits(len(f.data), f.is_extended) for f in frames]
    bits = sum(length.nominal for length in lengths)
    most_bits = sum(length.worst for length in lengths)
    bits_s = bitrate(run) * duration_s
    rows = [row.count for name, row in run.links().items() if name in CHANNELS]
    periods_s = np.diff(np.sort(t_s[[f.can_id == SYNC_ID for f in frames]]))
    return FieldBus(
        frames=len(frames),
        load=bits / bits_s if bits_s else 0.0,
        load_stuffed=most_bits / bits_s if bits_s else 0.0,
        errors=sum(count.bus_errors for count in rows),
        bus_off=any(count.bus_off for count in rows),
        sync_period_s=float(np.median(periods_s)) if periods_s.size else None,
        sync_jitter_s=float(np.ptp(periods_s)) / 2 if periods_s.size else None,
    )


def bitrate(run: RunLog) -> int:
    """Read the bit rate of the bus from the experiment."""
    tables = msgspec.json.decode(run.log.attachments["experiment.json"])
    can = tables.get("can") if isinstance(tables, dict) else None
    found = can.get("bitrate") if isinstance(can, dict) else None
    return found if isinstance(found, int) and found > 0 else DEFAULT_BITRATE
