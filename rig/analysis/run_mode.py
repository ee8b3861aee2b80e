"""Mode of a chain, as the summary of a run shows it."""

from __future__ import annotations

import msgspec


class RunMode(msgspec.Struct, kw_only=True):
    """Mode of a chain in the swing after the move, by `rig identify`."""

    frequency_hz: float
    damping_ratio: float
    amplitude_rad: float
    sigma_frequency_hz: float
    sigma_damping_ratio: float
    verdict: str  # of the identification: good or doubtful
