"""Parameters of the simulated ball-screw axis: motor, screw, table, friction, stops and sensors.

The defaults are the screw 20 x 20 of source 004, chapter 4.2; drag, viscous friction, bearing and
nut stiffness are typical values. A BallScrewParams that exists is valid.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, NamedTuple

import msgspec
from msgspec import Meta

from sim_rig.field_check import check_fields

GRAVITY_M_S2 = 9.81
# natural frequency or decay rate; beyond, a Taylor step is under 10 us
MAX_AXIS_RATE_RAD_S = 1e5

Lead = Annotated[float, Meta(ge=1e-4, le=1.0, description="give it in m per revolution")]
RotaryInertia = Annotated[float, Meta(ge=1e-9, le=1e3, description="give it in kg m2")]
Mass = Annotated[float, Meta(ge=1e-3, le=1e6, description="give it in kg")]
AddedMass = Annotated[float, Meta(ge=0.0, le=1e6, description="give it in kg, 0 for none")]
AxialStiffness = Annotated[float, Meta(ge=1e2, le=1e12, description="give it in N/m")]
Damping = Annotated[float, Meta(ge=0.0, le=1.0, description="give the damping ratio")]
Force = Annotated[float, Meta(ge=0.0, le=1e6, description="give it in N, 0 for none")]
LinearDamping = Annotated[float, Meta(ge=0.0, le=1e9, description="give it in N s/m, 0 for none")]
Drag = Annotated[float, Meta(ge=0.0, le=1e4, description="give it in N m, 0 for none")]
Efficiency = Annotated[float, Meta(ge=0.1, le=1.0, description="1 for a screw without losses")]
Slope = Annotated[float, Meta(ge=-90.0, le=90.0, description="degrees, positive = +X is uphill")]
PeakTorque = Annotated[float, Meta(gt=0.0, le=1e4, description="give it in N m")]
TorqueLag = Annotated[
    float, Meta(ge=0.0, le=10.0, description="time constant in s, 0 for none, else >= 1e-5")
]
SpeedLimit = Annotated[float, Meta(gt=0.0, description="give it in m/s, inf for none")]
AxisPosition = Annotated[float, Meta(ge=-1e3, le=1e3, description="give it in m")]
EncoderCounts = Annotated[int, Meta(ge=0, le=2**40, description="0 for an encoder without steps")]
Resolution = Annotated[float, Meta(ge=0.0, le=1.0, description="m, 0 for a scale without steps")]


class AxisCoefficients(NamedTuple):
    """Constants of the equations of motion in ball_screw_motion.py, computed once."""

    tau_m_rad: float
    inertia_kg_m2: float
    mass_kg: float
    stiffness_n_m: float
    damping_n_s_m: float
    coulomb_n: float
    viscous_n_s_m: float
    drag_n_m: float
    driving_m_rad: float  # tau / efficiency: screw torque per nut force, the motor drives
    driven_m_rad: float  # tau x efficiency: the load drives
    weight_n: float  # component along +X
    lag_rate_1_s: float  # 0 = no lag
    stop_stiffness_n_m: float
    stop_damping_n_s_m: float
    stops_m: tuple[float, float]  # negative, positive
    max_step_s: float  # of a Taylor step, off the stops
    max_stop_step_s: float  # against a stop


class BallScrewParams(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Axis of 0.8 m between its stops, 0.6 m useful, with 0 in the middle.

    Raises ValueError naming key, value, bound and next step; also for a rate beyond
    MAX_AXIS_RATE_RAD_S, and for stops, switches and start position out of order.
    """

    lead_m: Lead = 0.02
    rotary_inertia_kg_m2: RotaryInertia = 1.4961769e-4  # motor, coupling and screw
    table_mass_kg: Mass = 10.0
    # third of the screw, at the table (Rayleigh): source 004, omega_z = sqrt(k / (M + M_v / 3))
    screw_axial_mass_kg: AddedMass = 0.6534513
    # motor angle to table: torsion and axial strain of the screw, bearing, nut
    axial_stiffness_n_m: AxialStiffness = 3.5411215e7
    elastic_damping_ratio: Damping = 0.03  # of the table while the motor is locked
    coulomb_force_n: Force = 9.81  # guide, dry friction
    viscous_friction_n_s_m: LinearDamping = 20.0  # guide
    preload_drag_n_m: Drag = 0.16  # screw, dry friction
    efficiency: Efficiency = 0.95  # in both directions
    slope_deg: Slope = 0.0
    torque_limit_n_m: PeakTorque = 3.8
    torque_lag_s: TorqueLag = 0.0  # first order, from command to torque
    speed_limit_m_s: SpeedLimit = 1.0  # beyond, the fault flag is set; the motion is unaffected
    negative_stop_m: AxisPosition = -0.4
    positive_stop_m: AxisPosition = 0.4
    stop_stiffness_n_m: AxialStiffness = 1e7
    stop_damping_n_s_m: LinearDamping = 1e4
    negative_switch_m: AxisPosition = -0.35  # closed at and below
    positive_switch_m: AxisPosition = 0.35  # closed at and above
    encoder_counts_per_rev: EncoderCounts = 10_000  # 2500 lines, four edges each
    scale_resolution_m: Resolution | None = None  # linear scale at the table; None = no scale
    start_m: AxisPosition = 0.0  # position at rest at the start, spring relaxed

    def __post_init__(self) -> None:
        check_fields(self)
        self._check_order()
        if 0.0 < self.torque_lag_s < 1.0 / MAX_AXIS_RATE_RAD_S:
            raise ValueError(
                f"torque_lag_s = {self.torque_lag_s}; must be 0 or >= {1 / MAX_AXIS_RATE_RAD_S:g} "
                "s: give 0 for a current loop that fast"
            )
        for key, rate_rad_s in self._rates_rad_s().items():
            if rate_rad_s > MAX_AXIS_RATE_RAD_S:
                raise ValueError(
                    f"{key} = {getattr(self, key)} gives a rate of {rate_rad_s:.3g} rad/s; "
                    f"must be <= {MAX_AXIS_RATE_RAD_S:g} rad/s: "
                    "lower it, or raise the inertia or mass it acts on"
                )

    @property
    def tau_m_rad(self) -> float:
        """Travel per angle of the screw: lead / (2 pi) [m/rad]."""
        return self.lead_m / (2.0 * math.pi)

    @property
    def vibrating_mass_kg(self) -> float:
        """Mass on the axial spring: table and axial share of the screw."""
        return self.table_mass_kg + self.screw_axial_mass_kg

    @property
    def equivalent_mass_kg(self) -> float:
        """Equivalent mass of table and rotary inertia, as in source 004: M + J / tau^2.

        The simulated axis accelerates as this mass plus screw_axial_mass_kg.
        """
        return self.table_mass_kg + self.rotary_inertia_kg_m2 / self.tau_m_rad**2

    @property
    def elastic_damping_n_s_m(self) -> float:
        """Damping in parallel with the axial spring: 2 zeta_z sqrt(k m) [N s/m]."""
        critical = 2.0 * math.sqrt(self.axial_stiffness_n_m * self.vibrating_mass_kg)
        return self.elastic_damping_ratio * critical

    def coefficients(self) -> AxisCoefficients:
        """Compute the constants of the equations of motion."""
        rates = self._rates_rad_s()
        stop_rate = rates.pop("stop_stiffness_n_m") + rates.pop("stop_damping_n_s_m")
        lag_rate_1_s = rates["torque_lag_s"]
        rate = sum(rates.values())
        slope_rad = math.radians(self.slope_deg)
        tau_m_rad = self.tau_m_rad
        return AxisCoefficients(
            tau_m_rad=tau_m_rad,
            inertia_kg_m2=self.rotary_inertia_kg_m2,
            mass_kg=self.vibrating_mass_kg,
            stiffness_n_m=self.axial_stiffness_n_m,
            damping_n_s_m=self.elastic_damping_n_s_m,
            coulomb_n=self.coulomb_force_n,
            viscous_n_s_m=self.viscous_friction_n_s_m,
            drag_n_m=self.preload_drag_n_m,
            driving_m_rad=tau_m_rad / self.efficiency,
            driven_m_rad=tau_m_rad * self.efficiency,
            weight_n=self.table_mass_kg * GRAVITY_M_S2 * math.sin(-slope_rad) + 0.0,  # no -0.0
            lag_rate_1_s=lag_rate_1_s,
            stop_stiffness_n_m=self.stop_stiffness_n_m,
            stop_damping_n_s_m=self.stop_damping_n_s_m,
            stops_m=(self.negative_stop_m, self.positive_stop_m),
            max_step_s=1.0 / rate,
            max_stop_step_s=1.0 / (rate + stop_rate),
        )

    def _rates_rad_s(self) -> dict[str, float]:
        """Compute bounds of resonance and decay rates, by the key causing each."""
        reflected_kg = self.rotary_inertia_kg_m2 * self.efficiency / self.tau_m_rad**2
        mobility = 1.0 / self.vibrating_mass_kg + 1.0 / reflected_kg
        mass_kg = self.vibrating_mass_kg
        return {
            "axial_stiffness_n_m": math.sqrt(self.axial_stiffness_n_m * mobility),
            "elastic_damping_ratio": self.elastic_damping_n_s_m * mobility,
            "viscous_friction_n_s_m": self.viscous_friction_n_s_m / mass_kg,
            "torque_lag_s": 1.0 / self.torque_lag_s if self.torque_lag_s else 0.0,
            "stop_stiffness_n_m": math.sqrt(self.stop_stiffness_n_m / mass_kg),
            "stop_damping_n_s_m": self.stop_damping_n_s_m / mass_kg,
        }

    def _check_order(self) -> None:
        """Check that stops, switches and start position are in order along the axis."""
        keys = ("negative_stop_m", "negative_switch_m", "positive_switch_m", "positive_stop_m")
        for low, high in pairwise(keys):
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(
                    f"{low} = {getattr(self, low)}; must be < {high} = {getattr(self, high)}: "
                    "the order along X is stop, switch, switch, stop"
                )
        if not self.negative_stop_m <= self.start_m <= self.positive_stop_m:
            raise ValueError(
                f"start_m = {self.start_m}; must be {self.negative_stop_m} to "
                f"{self.positive_stop_m}, between the stops: start on the axis"
            )
