"""Statement of a planning problem and its result: a move of one axis without residual swing."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from planners.errors import PlanError, check_range, unknown_name
from planners.laws import LAWS
from planners.models.model import INPUTS, LAG_S, LAGS_S, Model, cart_for_input
from planners.trajectories.motion import Motion
from planners.trajectories.pieces import FloatArray

AXES = ("x", "y", "z")  # a vertical move, by a law alone, excites no swing
MAX_FAST_PERIODS = 1000.0  # move duration in periods of the fastest mode; a replay takes seconds
MIN_SLOW_PERIODS = 0.01  # move duration in periods of the slowest mode
MAX_LAGS = 1e5  # move duration in time constants of the jerk model's filter
MAX_WEIGHT = 1e12  # of a state or of the input
MAX_END_STATE = 1e3  # rad, rad/s, m/s, m/s^2: a state at an end
FARTHEST_M = 1000.0  # larger than any laboratory
HORIZONTAL_RAD = math.pi / 2  # beyond it a cable is slack and a linear model is invalid
LIMIT_EXCESS_REL = 1e-9  # share of a limit that a peak may exceed it by


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of the platform; a plan that exceeds them reports it by its status, nothing raises."""

    speed_m_s: float = math.inf
    acceleration_m_s2: float = math.inf

    def __post_init__(self) -> None:
        for name in ("speed_m_s", "acceleration_m_s2"):
            value = getattr(self, name)
            if not value > 0.0:
                raise PlanError(
                    f"{name} = {value} in limits; must be > 0: leave it out for no limit"
                )


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Move from start_m by distance_m in time_s, with the planner's model of the load.

    start_state and goal_state name the states that are not at rest there, e.g. {"angle_rad": 0.05};
    position_m is start_m and start_m + distance_m. A plan minimises
    1/2 int (sum of state_weights x state^2 + input_weight x input^2) dt.
    Raises PlanError for a value out of bounds or an unknown name.
    """

    distance_m: float
    time_s: float
    model: Model
    start_m: float = 0.0
    axis: str = "x"
    # "acceleration", "force", or "jerk": acceleration through a first-order lag, hence continuous
    input: str = "acceleration"
    lag_s: float = LAG_S  # of the jerk model
    nonlinear: bool = False  # plan for the nonlinear pendulum instead of its small swings
    robust: tuple[str, ...] = ()  # parameters of the model to whose error the plan is insensitive
    law: str = "harmonic"  # motion law that an input shaper convolves
    limits: Limits = field(default_factory=Limits)
    start_state: Mapping[str, float] = field(default_factory=dict)
    goal_state: Mapping[str, float] = field(default_factory=dict)
    state_weights: Mapping[str, float] = field(default_factory=dict)  # diagonal of Q
    input_weight: float = 1.0  # R

    def __post_init__(self) -> None:
        if not 0.0 < self.time_s < math.inf:
            raise PlanError(
                f"time_s = {self.time_s}; must be > 0 and finite: give the duration of the move"
            )
        self._check_periods()
        for name, value in (("start_m", self.start_m), ("distance_m", self.distance_m)):
            if not abs(value) <= FARTHEST_M:
                raise PlanError(
                    f"{name} = {value}; must be within +-{FARTHEST_M:g} m: give it in metres"
                )
        for what, name, known in (
            ("axis", self.axis, AXES),
            ("input", self.input, INPUTS),
            ("law", self.law, LAWS),
        ):
            if name not in known:
                raise unknown_name(what, name, known)
        for name in self.robust:
            if name not in self.model.parameters:
                raise unknown_name("parameter in robust", name, self.model.parameters)
        self._check_weights()
        self.start()
        self.goal()

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the model's states."""
        return self.model.state_space(self.input, lag_s=self.lag_s).states

    def start(self) -> FloatArray:
        """Assemble the state of the model at the start: (n,), in the order of its states."""
        return self._state("start_state", self.start_m, self.start_state)

    def goal(self) -> FloatArray:
        """Assemble the state of the model at time_s: (n,)."""
        return self._state("goal_state", self.start_m + self.distance_m, self.goal_state)

    @property
    def rest_to_rest(self) -> bool:
        """True if platform and load are at rest at both ends."""
        return not (np.any(self.start()[1:]) or np.any(self.goal()[1:]))

    def _state(self, what: str, position_m: float, values: Mapping[str, float]) -> FloatArray:
        states = self.states
        for name, value in values.items():
            if name not in states[1:]:
                raise unknown_name(f"name in {what}", name, states[1:])
            check_range(
                f"{name} in {what}", value, -MAX_END_STATE, MAX_END_STATE, "leave it out for rest"
            )
        return np.array([position_m, *(values.get(name, 0.0) for name in states[1:])])

    def _check_periods(self) -> None:
        """Raise PlanError unless the move lasts a sensible number of modal periods.

        At least 0.01 periods of the slowest mode, at most 1000 of the fastest one, and at most 1e5
        time constants of the jerk model's filter.
        """
        eigenvalues = self.model.modes(cart_for_input(self.input)).eigenvalues_1_s
        frequencies_hz = np.abs(eigenvalues) / (2.0 * math.pi)
        slow_periods = self.time_s * float(frequencies_hz.min())
        fast_periods = self.time_s * float(frequencies_hz.max())
        if slow_periods < MIN_SLOW_PERIODS:
            raise PlanError(
                f"time_s = {self.time_s} is {slow_periods:.3g} periods of the load; must be >= "
                f"{MIN_SLOW_PERIODS:g}: give it more time"
            )
        if fast_periods > MAX_FAST_PERIODS:
            raise PlanError(
                f"time_s = {self.time_s} is {fast_periods:.6g} periods of the load's fastest mode; "
                f"must be <= {MAX_FAST_PERIODS:g}: "
                "shorten the move, or check lengths, masses, stiffness and damping"
            )
        if self.input == "jerk" and self.time_s > MAX_LAGS * self.lag_s:
            min_lag_s = self.time_s / MAX_LAGS
            raise PlanError(
                f"lag_s = {self.lag_s}; must be >= time_s / {MAX_LAGS:g} = {min_lag_s:g}: "
                "take a slower filter"
            )

    def _check_weights(self) -> None:
        check_range("lag_s", self.lag_s, *LAGS_S, "leave it out for the default")
        check_range(
            "input_weight",
            self.input_weight,
            1.0 / MAX_WEIGHT,
            MAX_WEIGHT,
            "leave it out for the default",
        )
        for name, value in self.state_weights.items():
            if name not in self.states:
                raise unknown_name("name in state_weights", name, self.states)
            check_range(f"{name} in state_weights", value, 0.0, MAX_WEIGHT, "leave it out for 0")


class Status(enum.Enum):
    """Status of a plan: permitted to run, or over the limits."""

    OK = "ok"
    OVER_LIMITS = "over_limits"


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """Peaks and root mean squares over a move; residuals are swing amplitudes at its end."""

    peak_swing_rad: float  # nonlinear replay
    residual_swing_rad: float  # linear model
    residual_swing_nonlinear_rad: float
    peak_speed_m_s: float
    rms_speed_m_s: float
    peak_acceleration_m_s2: float
    rms_acceleration_m_s2: float
    travel_m: float  # highest minus lowest position
    acceleration_continuous: bool


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Motion with the problem it solves and its metrics."""

    planner: str
    problem: Problem
    motion: Motion
    metrics: Metrics
    compute_s: float | None  # computing time of the planner alone; None when not timed

    @property
    def status(self) -> Status:
        """OK, or OVER_LIMITS if there are reasons."""
        return Status.OVER_LIMITS if self.reasons else Status.OK

    @property
    def reasons(self) -> tuple[str, ...]:
        """Exceeded limits, incl. a swing beyond the horizontal: value, bound and next step."""
        limits, metrics = self.problem.limits, self.metrics
        peak_m_s2 = metrics.peak_acceleration_m_s2
        checks = (
            ("peak speed", metrics.peak_speed_m_s, "m/s", limits.speed_m_s),
            ("peak acceleration", peak_m_s2, "m/s^2", limits.acceleration_m_s2),
            ("peak swing", metrics.peak_swing_rad, "rad", HORIZONTAL_RAD),
        )
        return tuple(
            f"{what} = {value:.6g} {unit}; limit {bound:g} {unit}: "
            f"give the move more than time_s = {self.problem.time_s:g}"
            for what, value, unit, bound in checks
            if value > bound * (1.0 + LIMIT_EXCESS_REL)
        )
