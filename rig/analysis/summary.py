"""Summary of a run, in the keys of `rig run --json`; every number comes from the log alone."""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec

from rig.analysis.run_mode import RunMode


class Quantities(msgspec.Struct, kw_only=True):
    """The five quantities of a run; None = not identifiable in this run."""

    peak_swing_rad: float | None = None
    residual_swing_rad: float | None = None
    natural_frequency_hz: float | None = None
    damping_ratio: float | None = None
    cable_length_m: float | None = None


class BudgetTerm(msgspec.Struct, kw_only=True):
    """One standard deviation that a cause adds to each quantity; None where it adds none."""

    term: str
    peak_swing_rad: float | None = None
    residual_swing_rad: float | None = None
    natural_frequency_hz: float | None = None
    damping_ratio: float | None = None
    cable_length_m: float | None = None


class Quantity(NamedTuple):
    """Title, factor and decimals with which a quantity is shown."""

    key: str
    title: str
    factor: float
    digits: int

    def plain(self, value: float | None) -> str:
        """Format the value; empty for None."""
        return "" if value is None else f"{value * self.factor:.{self.digits}f}"

    def with_sigma(self, value: float | None, sigma: float | None) -> str:
        """Format the value with two digits of its standard deviation."""
        if value is None:
            return "not identifiable in this run"
        if sigma is None or not 0 < sigma < math.inf:
            return self.plain(value)
        digits = max(0, 1 - math.floor(math.log10(sigma * self.factor)))
        return f"{value * self.factor:.{digits}f} ± {sigma * self.factor:.{digits}f}"


QUANTITIES = (
    Quantity("peak_swing_rad", "peak swing, mrad", 1e3, 2),
    Quantity("residual_swing_rad", "residual swing, mrad", 1e3, 3),
    Quantity("natural_frequency_hz", "natural frequency, Hz", 1.0, 5),
    Quantity("damping_ratio", "damping ratio", 1.0, 6),
    Quantity("cable_length_m", "cable length, m", 1.0, 4),
)


class Planned(msgspec.Struct, kw_only=True):
    """Swing predicted by the plan."""

    peak_swing_rad: float | None = None
    residual_swing_rad: float | None = None


class Latency(msgspec.Struct, kw_only=True):
    """Delays [ms]."""

    command: float | None = None  # of the platform behind the plan
    vision: float | None = None  # from the stamp of an angle to its arrival at the streamer
    alignment: float | None = None  # of the measured swing behind the truth; zero for true stamps
    # standard deviations of the two alignments
    command_sigma: float | None = None
    alignment_sigma: float | None = None
    # from end of exposure to arrival of the angle, with the delays of the experiment's links
    exposure_to_angle_p99: float | None = None


class SwingError(msgspec.Struct, kw_only=True):
    """Rms of measured minus true angle at t_valid [rad]; no delay is fitted."""

    during_move_rad: float | None = None
    outside_move_rad: float | None = None


class Lateness(msgspec.Struct, kw_only=True):
    """Late references and late ticks."""

    references: int = 0  # accepted
    references_late: int = 0  # accepted more than 30 ms after t_target
    reference_p99_ms: float | None = None
    reference_max_ms: float | None = None
    late_ticks: dict[str, int] = {}


class MotionPeaks(msgspec.Struct, kw_only=True):
    """Peaks of what was asked of the robot and of what it reached, and the bounds on them.

    Accelerations are changes of speed over 30 ms. None = not in the log.
    """

    policy: str | None = None  # of the interpolator
    asked_speed_m_s: float | None = None
    reached_speed_m_s: float | None = None
    speed_bound_m_s: float | None = None
    asked_acceleration_m_s2: float | None = None
    reached_acceleration_m_s2: float | None = None
    acceleration_bound_m_s2: float | None = None
    # rms of actual minus planned position over the move: by the delay, and what no delay explains
    tracking_delay_rms_m: float | None = None
    tracking_distortion_rms_m: float | None = None
    following_error_m: float | None = None  # of the robot behind the setpoint of the servo lag ago
    following_error_bound_m: float | None = None
    setpoints_outside: int = 0  # beyond a bound of speed or acceleration

    @property
    def asked_text(self) -> str:
        """Peaks asked beside their bounds."""
        speed = _beside(self.asked_speed_m_s, self.speed_bound_m_s)
        acceleration = _beside(self.asked_acceleration_m_s2, self.acceleration_bound_m_s2)
        return f"asked {speed} m/s, {acceleration} m/s2"

    @property
    def text(self) -> str:
        """Peaks asked and reached beside their bounds, in one line."""
        speed = _beside(self.reached_speed_m_s, self.speed_bound_m_s)
        acceleration = _beside(self.reached_acceleration_m_s2, self.acceleration_bound_m_s2)
        error = _beside(_mm(self.following_error_m), _mm(self.following_error_bound_m))
        reached = f"reached {speed} m/s, {acceleration} m/s2"
        return f"{self.asked_text}; {reached}; following error {error} mm{self._tracking_text}"

    @property
    def _tracking_text(self) -> str:
        by_delay, left = _mm(self.tracking_delay_rms_m), _mm(self.tracking_distortion_rms_m)
        if by_delay is None or left is None:
            return ""
        return f"; off the plan by {by_delay:.2f} mm rms of delay and {left:.2f} mm of distortion"


def _mm(value_m: float | None) -> float | None:
    return None if value_m is None else value_m * 1e3


def _beside(value: float | None, bound: float | None) -> str:
    """Format a peak with its bound, where there is one."""
    shown = "-" if value is None else f"{value:.2f}"
    return shown if bound is None else f"{shown} of {bound:.2f}"


class LinkSummary(msgspec.Struct, kw_only=True):
    """Row of the ledger: sent = delivered + lost + rejected + unexplained.

    late and superseded ones are among the delivered; copies and foreign ones are outside the sum.
    """

    sent: int
    delivered: int
    lost: int
    duplicated: int
    late: int
    superseded: int  # overtaken by a newer one, so not used
    foreign: int  # not from the sender of the link
    rejected: dict[str, int]
    lost_link: int
    lost_kernel: int
    lost_queue: int
    unexplained: int


class Across(msgspec.Struct, kw_only=True):
    """Swing across the plane of the move, seen by the camera of the other plane.

    None = not identifiable in this run; true values are None on a real rig.
    """

    camera: int
    frames: int = 0
    angles_valid: int = 0
    peak_rad: float | None = None
    sigma_peak_rad: float | None = None
    residual_rad: float | None = None
    sigma_residual_rad: float | None = None
    true_peak_rad: float | None = None
    true_residual_rad: float | None = None

    @property
    def row(self) -> tuple[str, str, str]:
        """Title, measured and true values for a table: peak / residual swing."""
        peak, residual = QUANTITIES[:2]
        measured = (
            peak.with_sigma(self.peak_rad, self.sigma_peak_rad),
            residual.with_sigma(self.residual_rad, self.sigma_residual_rad),
        )
        true = ""
        if self.true_peak_rad is not None:
            true = f"{peak.plain(self.true_peak_rad)} / {residual.plain(self.true_residual_rad)}"
        title = f"across (camera {self.camera}): peak / residual, mrad"
        return title, " / ".join(measured), true


class FieldBus(msgspec.Struct, kw_only=True):
    """Field bus of a run with a drive; loads are shares of the bit rate."""

    frames: int
    load: float  # without stuff bits
    load_stuffed: float  # with the most stuff bits
    errors: int  # frames corrupted, and repeated
    bus_off: bool
    sync_period_s: float | None  # median
    sync_jitter_s: float | None  # half the range


class JointFigures(msgspec.Struct, kw_only=True):
    """Figures of the move of an elastic joint, see MoveMetrics; true ones are None on a real rig.

    Shares are of the largest reference speed; the residual is that of the load after the move.
    """

    controller: str
    residual_measured: float  # share, from the accelerometer
    residual_sigma: float  # share: noise of the accelerometer, integrated over the move
    residual: float | None = None  # share, true
    settled_s: float | None = None  # from the end of the reference; None if never
    speed_error: float | None = None  # share, rms over the run
    overshoot_deg: float | None = None
    final_error_deg: float | None = None
    arrived: bool | None = None
    peak_torque_n_m: float = 0.0
    rms_torque_n_m: float = 0.0
    rest_torque_n_m: float = 0.0
    at_limit_s: float = 0.0  # time at the torque limit


class Summary(msgspec.Struct, kw_only=True):
    """Summary of a run."""

    run_id: str
    run_dir: str
    mode: str
    experiment: str
    exit_status: str  # ok | stopped | fault | bad_data
    exit_code: int
    verdict: str  # good | doubtful | bad
    reasons: list[str]
    planner: str
    move_m: float
    move_time_s: float
    measured: Quantities
    sigma: Quantities  # whole standard deviations
    truth: Quantities | None
    planned: Planned
    latency_ms: Latency
    links: dict[str, LinkSummary]
    digest: str | None
    sigma_noise: Quantities = msgspec.field(default_factory=Quantities)  # of the noise alone
    budget: list[BudgetTerm] = []
    modes: list[RunMode] = []  # of a load that [model] says is a chain
    # from the planned end of the move until the swing stays within [analysis] settling_band_rad
    settling_s: float | None = None
    initial_swing_rad: float | None = None
    swing_error: SwingError = msgspec.field(default_factory=SwingError)
    lateness: Lateness = msgspec.field(default_factory=Lateness)
    motion: MotionPeaks = msgspec.field(default_factory=MotionPeaks)
    across: Across | None = None  # of a run with a camera of each plane
    field_bus: FieldBus | None = None  # of a run with a drive
    joint: JointFigures | None = None  # of a run of an elastic joint
    move_deg: float | None = None  # of its load
    frames: int = 0
    angles_valid: int = 0
    refusals: dict[str, int] = {}  # frames without an angle, by reason
    swing_fit_rms_rad: float | None = None
    complete: bool = True
    running_s: float | None = None  # duration so far, of a run that goes on
    loop_s: float | None = None
    cpu_share: dict[str, float] = {}  # of one core, by process, during the run; wall mode only
    scheduling: dict[str, str] = {}  # fifo or other, by task; wall mode only
    events: list[str] = []

    @property
    def headline(self) -> str:
        """One-line description of the run."""
        if self.move_time_s == 0:
            return f"{self.experiment}: watched, no move"
        if self.move_deg is not None:
            controller = f"{self.joint.controller}, " if self.joint else ""
            return f"{self.experiment}: {controller}{self.move_deg:g}° in {self.move_time_s:g} s"
        return f"{self.experiment}: {self.planner}, {self.move_m:g} m in {self.move_time_s:g} s"
