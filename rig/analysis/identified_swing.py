"""Identification of the swing after the move of a run, as it stands in its log."""

from __future__ import annotations

import math

from rig.analysis.identify.identification import Identification
from rig.analysis.identify.identify import identify_record
from rig.analysis.identify.identify_options import IdentifyOptions
from rig.analysis.run_log import RunLog
from rig.analysis.run_mode import RunMode

MIN_MODE_SHARE = 0.01  # of the largest amplitude; less is a line of the pictures
# relative frequency of a chain over the squared amplitude [1/rad2], one standard deviation: the
# lower links swing further than the first one, which is seen; two equal masses have 1.7
AMPLITUDE_TERM = 1.0


def identify_swing(run: RunLog) -> Identification:
    """Identify the load, a pendulum of one or more modes, from the settled instant on."""
    t_s, angle_rad, _ = run.swing
    terms = run.facts.analysis
    scale_rel = terms.angle_scale_rel
    if scale_rel is None:
        scale_rel = run.angle_scale_of(run.main_camera).sigma_rel
    options = IdentifyOptions(
        unit="rad",
        kind="pendulum",
        from_s=run.t_settled_s,
        average_frames=run.facts.average_frames,
        frame_period_s=1.0 / run.facts.rate_of(run.main_camera),
        angle_scale_rel=scale_rel,
        clock_ppm=terms.clock_ppm,
        gain_drift_rel=terms.gain_drift_rel,
        gravity_m_s2=run.facts.gravity_m_s2,
        gravity_sigma_m_s2=terms.gravity_sigma_m_s2,
    )
    return identify_record(t_s, angle_rad, options)


def chain_modes(run: RunLog) -> list[RunMode]:
    """List the modes of a load that [model] says is a chain, slowest first; [] of a cable."""
    if not (run.facts.is_chain and run.facts.rate_hz) or run.t_start_s is None:
        return []
    found = identify_swing(run)
    least_rad = MIN_MODE_SHARE * max((mode.amplitude for mode in found.modes), default=0.0)
    modes = [
        RunMode(
            frequency_hz=mode.frequency_hz,
            damping_ratio=mode.damping_ratio,
            amplitude_rad=mode.amplitude,
            sigma_frequency_hz=math.hypot(
                mode.sigma_frequency_hz, AMPLITUDE_TERM * mode.amplitude**2 * mode.frequency_hz
            ),
            sigma_damping_ratio=mode.sigma_damping_ratio,
            verdict=found.verdict,
        )
        for mode in found.modes
        if mode.amplitude >= least_rad
    ]
    return sorted(modes, key=lambda mode: mode.frequency_hz)
