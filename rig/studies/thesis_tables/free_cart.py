"""Free cart with two bars under a force: nonlinear bench beside the planners' linear model.

The case is that of source 004, section 4.2, where the source compares two programs. Its joint is
printed in N/m and N s/m; the equations need N m/rad and N m s/rad.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from planners.models.chain import ChainModel, Link
from planners.models.model import Cart
from planners.replay.swing import Swing
from planners.trajectories.pieces import FloatArray
from rig.studies.thesis_tables.bench import CartMotion, ForceStep, nonlinear_motion

BARS = (Link(0.2, 1.35), Link(0.15, 1.0125))  # aluminium of 50 mm x 50 mm
STIFFNESS_N_M_RAD = 10.0
JOINT_DAMPING_N_M_S_RAD = 2.214e-4
START_RAD = math.pi / 6.0  # both bars, at rest
FORCES = (ForceStep(2.0, 2.0), ForceStep(2.0, -2.0), ForceStep(6.0, 0.0))
FREE_FROM_S = 4.0  # no force from here on
PRINTED_MASS_KG = 10.5223
PRINTED_MODE_HZ = 1.0759  # appendix C, same bars
MOTOR_KG_M2 = 2.16e-5
SCREW_KG_M2 = 4.0148e-5  # its exponent is printed as +5
LEAD_M = 0.016
NUT_KG = 10.0
SAMPLE_S = 0.01
SMALL_START_RAD = math.radians(1.0)
SMALL_FORCES = (ForceStep(4.0, 0.0),)

# bounds of the expected relations; a simple pendulum of 30 degrees is 1.7 % slower than a small one
MAX_PEAK_DIFFERENCE_REL = 0.02
FREQUENCY_CHANGE_REL = (-0.04, -0.01)
MAX_SMALL_CHANGE_REL = 1e-4
MAX_PRINTED_CHANGE_REL = 2e-4  # the printed frequency has five digits


class CartFigures(NamedTuple):
    """Figures of one motion; travel from the start, angles absolute."""

    travel_end_m: float
    travel_peak_m: float
    theta1_peak_rad: float
    theta2_peak_rad: float
    frequency_hz: float  # of the slow mode after the force


class FreeCartCase(NamedTuple):
    """Motions and figures of the source's case with one equivalent mass of the cart."""

    cart_mass_kg: float
    bench: CartMotion
    linear: CartMotion
    bench_figures: CartFigures
    linear_figures: CartFigures
    small_frequency_hz: float  # of the bench from SMALL_START_RAD without force
    free_modes_hz: tuple[float, ...]  # damped, slowest first
    driven_modes_hz: tuple[float, ...]

    @property
    def frequency_change_rel(self) -> float:
        """Relative change of the bench's frequency from the linear mode to 30 degrees."""
        return self.bench_figures.frequency_hz / self.free_modes_hz[0] - 1.0

    @property
    def small_change_rel(self) -> float:
        """Relative change of the bench's frequency from the linear mode to 1 degree."""
        return self.small_frequency_hz / self.free_modes_hz[0] - 1.0


class ExpectedRelation(NamedTuple):
    """Relative difference with the bounds in which it is expected."""

    name: str
    value_rel: float
    low_rel: float
    high_rel: float

    @property
    def holds(self) -> bool:
        """True if the difference is within its bounds."""
        return self.low_rel <= self.value_rel <= self.high_rel


def equivalent_mass_kg() -> float:
    """Compute nut + (motor + screw) / (lead / 2 pi)^2, the mass that the force moves."""
    m_per_rad = LEAD_M / (2.0 * math.pi)
    return NUT_KG + (MOTOR_KG_M2 + SCREW_KG_M2) / m_per_rad**2


def load_model(cart_mass_kg: float) -> ChainModel:
    """Create the planners' model of the source's bars under a cart of that mass."""
    return ChainModel(
        links=BARS,
        stiffness_n_m_rad=(STIFFNESS_N_M_RAD,),
        joint_damping_n_m_s_rad=(JOINT_DAMPING_N_M_S_RAD,),
        cart_mass_kg=cart_mass_kg,
    )


def free_cart_cases() -> tuple[FreeCartCase, FreeCartCase]:
    """Simulate the case with the printed equivalent mass, then with that of its parts."""
    return free_cart_case(PRINTED_MASS_KG), free_cart_case(equivalent_mass_kg())


@cache
def free_cart_case(cart_mass_kg: float) -> FreeCartCase:
    """Simulate the case on the bench and on the linear model: about 3 s."""
    model = load_model(cart_mass_kg)
    bench = nonlinear_motion(model, START_RAD, FORCES, SAMPLE_S)
    linear = linear_motion(model)
    small = nonlinear_motion(model, SMALL_START_RAD, SMALL_FORCES, SAMPLE_S)
    return FreeCartCase(
        cart_mass_kg=cart_mass_kg,
        bench=bench,
        linear=linear,
        bench_figures=motion_figures(model, bench),
        linear_figures=motion_figures(model, linear),
        small_frequency_hz=slow_frequency_hz(model, small, 0.0),
        free_modes_hz=damped_modes_hz(model, "free"),
        driven_modes_hz=damped_modes_hz(model, "driven"),
    )


def linear_motion(model: ChainModel) -> CartMotion:
    """Compute the motion of the linear model with force input, exact at the samples.

    x(t + h) = expm([[a, b], [0, 0]] h) [x(t), F] while F is constant.
    """
    space = model.state_space("force")
    n = model.links_count
    size = len(space.states)
    augmented = np.zeros((size + 1, size + 1))
    augmented[:size, :size], augmented[:size, size:] = space.a, space.b
    transition = expm(SAMPLE_S * augmented)
    state = np.zeros(size + 1)
    state[2 : 2 + n] = START_RAD
    states = [state]
    for step in FORCES:
        for _ in range(round(step.duration_s / SAMPLE_S)):
            state = states[-1].copy()
            state[size] = step.force_n
            states.append(transition @ state)
    x = np.array(states)
    t_s = SAMPLE_S * np.arange(len(x), dtype=np.float64)
    return CartMotion(t_s, x[:, 0], x[:, 2 : 2 + n], x[:, 2 + n : 2 + 2 * n])


def motion_figures(model: ChainModel, motion: CartMotion) -> CartFigures:
    """Compute travel, peak angles and the frequency of the free swing."""
    peaks_rad = [_peak_rad(motion, link) for link in range(model.links_count)]
    return CartFigures(
        travel_end_m=float(motion.position_m[-1]),
        travel_peak_m=float(np.abs(motion.position_m).max()),
        theta1_peak_rad=peaks_rad[0],
        theta2_peak_rad=peaks_rad[1],
        frequency_hz=slow_frequency_hz(model, motion, FREE_FROM_S),
    )


def slow_frequency_hz(model: ChainModel, motion: CartMotion, from_s: float) -> float:
    """Fit the frequency of the slow mode from from_s on, where no force acts.

    Slope of the phase of its modal coordinate under a free cart, by least squares.
    """
    modes = model.modes("free")
    slow = modes.left_eigenvectors[modes.upper[0]]
    is_free = motion.t_s >= from_s - SAMPLE_S / 2.0
    states = np.hstack([motion.angles_rad, motion.rates_rad_s])[is_free]
    phase_rad = np.unwrap(np.angle(states @ slow))
    slope_rad_s = np.polyfit(motion.t_s[is_free], phase_rad, 1)[0]
    return float(slope_rad_s) / (2.0 * math.pi)


def damped_modes_hz(model: ChainModel, cart: Cart) -> tuple[float, ...]:
    """Compute the damped frequencies of the linear modes, slowest first."""
    modes = model.modes(cart)
    rates: FloatArray = modes.eigenvalues_1_s[modes.upper].imag
    return tuple((rates / (2.0 * math.pi)).tolist())


def expected_relations(cases: tuple[FreeCartCase, FreeCartCase]) -> list[ExpectedRelation]:
    """Compare amplitudes and frequencies of bench and linear model, and the printed frequency."""
    relations = []
    for case in cases:
        label = f"{case.cart_mass_kg:.4f} kg"
        bound_rel = MAX_PEAK_DIFFERENCE_REL
        difference_rel = _peak_difference_rel(case)
        relations += [
            ExpectedRelation(
                f"{label}: peaks, bench to linear model", difference_rel, -bound_rel, bound_rel
            ),
            ExpectedRelation(
                f"{label}: frequency, 30° to linear mode",
                case.frequency_change_rel,
                *FREQUENCY_CHANGE_REL,
            ),
            ExpectedRelation(
                f"{label}: frequency, 1° to linear mode",
                case.small_change_rel,
                -MAX_SMALL_CHANGE_REL,
                MAX_SMALL_CHANGE_REL,
            ),
        ]
    mode_hz = cases[1].free_modes_hz[0]
    relations.append(
        ExpectedRelation(
            f"{cases[1].cart_mass_kg:.4f} kg: linear mode to printed {PRINTED_MODE_HZ} Hz",
            mode_hz / PRINTED_MODE_HZ - 1.0,
            -MAX_PRINTED_CHANGE_REL,
            MAX_PRINTED_CHANGE_REL,
        )
    )
    return relations


def _peak_difference_rel(case: FreeCartCase) -> float:
    """Compute the largest relative difference of peak travel and angles, with its sign."""
    bench, linear = case.bench_figures, case.linear_figures
    pairs = (
        (bench.travel_peak_m, linear.travel_peak_m),
        (bench.theta1_peak_rad, linear.theta1_peak_rad),
        (bench.theta2_peak_rad, linear.theta2_peak_rad),
    )
    return max((b / a - 1.0 for b, a in pairs), key=abs)


def _peak_rad(motion: CartMotion, link: int) -> float:
    angle_rad = motion.angles_rad[:, [link]]
    return Swing(motion.t_s, angle_rad, motion.rates_rad_s[:, [link]]).peak_rad()
