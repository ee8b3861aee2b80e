"""Options of an identification: knowledge of the caller that the record does not have."""

from __future__ import annotations

from dataclasses import dataclass

from rig.analysis.identify.errors import AnalysisError

KINDS = ("auto", "pendulum", "linear")
MAX_MODES = 4


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """Unit, model and systematic uncertainties of a record.

    Raises AnalysisError for a value outside its bounds.
    """

    unit: str = "rad"  # rad or deg: pendulum under kind auto; any other: linear
    kind: str = "auto"
    modes: int | None = None  # None: as many as the record shows, 1 to 4
    from_s: float | None = None  # stamps of the record between which the decay is sought
    to_s: float | None = None
    average_frames: int = 1  # each value is the centred mean of so many frames
    frame_period_s: float = 0.0  # 0: the median step of the stamps
    angle_scale_rel: float = 3e-4  # one standard deviation each, from here on
    clock_ppm: float = 20.0
    gain_drift_rel: float = 1e-3  # from the first sample of the window to the last
    gravity_m_s2: float = 9.81
    gravity_sigma_m_s2: float = 0.01

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise AnalysisError(f"kind = {self.kind}; must be one of {', '.join(KINDS)}")
        if self.modes is not None and not 1 <= self.modes <= MAX_MODES:
            raise AnalysisError(f"modes = {self.modes}; must be 1 to {MAX_MODES}")
        if self.average_frames < 1:
            raise AnalysisError(f"average_frames = {self.average_frames}; must be >= 1")

    @property
    def is_pendulum(self) -> bool:
        """Tell if the frequency follows the amplitude as that of a pendulum does."""
        if self.kind == "auto":
            return self.unit in ("rad", "deg")
        return self.kind == "pendulum"
