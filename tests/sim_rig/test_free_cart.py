"""Free cart with a chain, against momentum, work, the modes of planners, and MuJoCo."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from planners.models.chain import ChainModel, Link
from sim_rig.free_cart import FreeCart
from sim_rig.load_params import LinkParams, LoadParams
from sim_rig.spatial_chain import SpatialChain

FloatArray = NDArray[np.float64]
STEP_S = 0.01
G = 9.81
FREE = LoadParams(damping_ratio=0.0)
CART_KG = 19.5223
FORCES_N = ((2.0, 200), (-2.0, 200), (0.0, 600))  # with steps of STEP_S
STIFFNESS_N_M_RAD, DAMPING_N_M_S_RAD = 10.0, 2.214e-4
BARS = [  # source 004, section 4.2
    LinkParams(length_m=0.2, mass_kg=1.35, kind="bar", initial_x_rad=math.pi / 6),
    LinkParams(
        length_m=0.15,
        mass_kg=1.0125,
        kind="bar",
        initial_x_rad=math.pi / 6,
        joint_stiffness_n_m_rad=STIFFNESS_N_M_RAD,
        joint_damping_n_m_s_rad=DAMPING_N_M_S_RAD,
    ),
]
SPATIAL = [
    LinkParams(length_m=0.4, mass_kg=0.8, initial_x_rad=0.4, initial_y_rad=0.3),
    LinkParams(length_m=0.3, mass_kg=1.2, kind="bar", initial_rate_x_rad_s=1.0),
]


def undamped(links: list[LinkParams]) -> list[LinkParams]:
    """Copy links without dampers."""
    return [msgspec.structs.replace(link, joint_damping_n_m_s_rad=0.0) for link in links]


def centre_shares(links: list[LinkParams]) -> list[float]:
    """Centre of mass of each link over its length."""
    return [0.5 if link.kind == "bar" else 1.0 for link in links]


def offsets_m(cart: FreeCart, links: list[LinkParams]) -> list[float]:
    """Place of each centre of mass along x, from the pivot."""
    upper_m, places = 0.0, []
    for link, share, angles in zip(links, centre_shares(links), cart.links, strict=True):
        x, y = math.tan(angles.angle_x_rad), math.tan(angles.angle_y_rad)
        along = x / math.sqrt(1.0 + x * x + y * y)
        places.append(upper_m + share * link.length_m * along)
        upper_m += link.length_m * along
    return places


def planar_momentum_n_s(cart: FreeCart, links: list[LinkParams]) -> float:
    """Momentum of cart and links along x, from the velocities of the centres of mass."""
    upper_m_s = cart.velocity_m_s
    total_n_s = CART_KG * upper_m_s
    for link, share, angles in zip(links, centre_shares(links), cart.links, strict=True):
        along_m_s = link.length_m * math.cos(angles.angle_x_rad) * angles.rate_x_rad_s
        total_n_s += link.mass_kg * (upper_m_s + share * along_m_s)
        upper_m_s += along_m_s
    return total_n_s


def test_the_momentum_of_cart_and_load_changes_by_the_impulse_of_the_force() -> None:
    cart = FreeCart(CART_KG, BARS, FREE)
    expected_n_s = planar_momentum_n_s(cart, BARS)
    for force_n, steps in ((2.0, 90), (-3.0, 40), (0.0, 50)):
        cart.advance(STEP_S, steps, force_n)
        expected_n_s += force_n * steps * STEP_S
        assert planar_momentum_n_s(cart, BARS) == pytest.approx(expected_n_s, abs=1e-9)


def test_the_common_centre_of_mass_moves_as_one_mass_under_the_force() -> None:
    """Two links out of plane, the lower one turning at the start."""
    cart = FreeCart(CART_KG, SPATIAL, FREE)
    masses_kg = np.array([link.mass_kg for link in SPATIAL])
    total_kg = CART_KG + masses_kg.sum()
    start_m = masses_kg @ offsets_m(cart, SPATIAL) / total_kg
    # the lower bar turns from the vertical: its centre moves with l / 2 theta'
    speed_m_s = masses_kg[1] * 0.15 * 1.0 / total_kg
    force_n, time_s = 4.0, 1.5
    cart.advance(STEP_S, 150, force_n)
    centre_m = cart.position_m + masses_kg @ offsets_m(cart, SPATIAL) / total_kg
    expected_m = start_m + speed_m_s * time_s + 0.5 * force_n / total_kg * time_s**2
    assert centre_m == pytest.approx(expected_m, abs=1e-9)


@pytest.mark.parametrize("links", [undamped(BARS), SPATIAL])
def test_the_energy_changes_by_the_work_of_the_force(links: list[LinkParams]) -> None:
    """Without a force it is conserved: F times the path of the cart is the work."""
    cart = FreeCart(CART_KG, links, FREE)
    before_j = cart.energy_j
    cart.advance(STEP_S, 200)
    assert cart.energy_j == pytest.approx(before_j, rel=1e-8)
    start_m = cart.position_m
    cart.advance(STEP_S, 100, 5.0)
    work_j = 5.0 * (cart.position_m - start_m)
    assert work_j > 0.1
    assert cart.energy_j == pytest.approx(before_j + work_j, rel=1e-8)


def test_the_velocity_is_the_derivative_of_the_position() -> None:
    cart = FreeCart(CART_KG, BARS, FREE)
    cart.advance(STEP_S, 33, 2.0)
    step_s, positions, velocities = 1e-4, [], []
    for _ in range(3):
        positions.append(cart.position_m)
        velocities.append(cart.velocity_m_s)
        cart.advance(step_s, 1, 2.0)
    slope_m_s = (positions[2] - positions[0]) / (2.0 * step_s)
    assert velocities[1] == pytest.approx(slope_m_s, abs=1e-7)


def test_a_very_heavy_cart_is_a_pivot_at_rest() -> None:
    cart, chain = FreeCart(1e12, BARS, FREE), SpatialChain(BARS, FREE)
    cart.advance(STEP_S, 100, 5.0)
    chain.advance_at_rest(STEP_S, 100)
    for free, held in zip(cart.links, chain.links, strict=True):
        assert free.angle_x_rad == pytest.approx(held.angle_x_rad, abs=1e-7)


@pytest.mark.parametrize("cart_mass_kg", [2.0, CART_KG])
@pytest.mark.parametrize("mode", [0, 1])
def test_small_oscillations_have_the_free_cart_modes_of_planners(
    mode: int, cart_mass_kg: float
) -> None:
    """Each mode shape at 1 mrad swings at its own frequency, to 1e-4."""
    model = ChainModel(
        links=tuple(Link(one.length_m, one.mass_kg) for one in BARS),
        stiffness_n_m_rad=(STIFFNESS_N_M_RAD,),
        cart_mass_kg=cart_mass_kg,
    )
    modes = model.modes("free")
    index = modes.upper[mode]
    shape = modes.mode_shapes[:2, index]
    angles_rad = 1e-3 * (shape / shape[np.abs(shape).argmax()]).real
    links = [
        msgspec.structs.replace(link, initial_x_rad=angle)
        for link, angle in zip(undamped(BARS), angles_rad.tolist(), strict=True)
    ]
    # at a quarter of a period the angle crosses 0 at its largest rate
    quarter_s = 0.5 * math.pi / modes.eigenvalues_1_s[index].imag
    periods = 2
    time_s = (4 * periods + 1) * quarter_s
    cart = FreeCart(cart_mass_kg, links, FREE)
    cart.advance(time_s / 500, 500)
    for link in cart.links:
        late_s = link.angle_x_rad / link.rate_x_rad_s
        assert abs(late_s) / time_s < 1e-4


def mujoco_motion(links: list[LinkParams], h: float) -> FloatArray:
    """Position and absolute angles after FORCES_N, by MuJoCo with steps h: (1 + n,)."""
    mujoco = pytest.importorskip("mujoco")
    bodies, above_m = "", 0.0
    for link in links:
        inertia = link.mass_kg * link.length_m**2 / 12.0
        bodies += (
            f'<body pos="0 0 {-above_m}"><joint type="hinge" axis="0 -1 0" '
            f'stiffness="{link.joint_stiffness_n_m_rad}" '
            f'damping="{link.joint_damping_n_m_s_rad}"/>'
            f'<inertial pos="0 0 {-link.length_m / 2}" mass="{link.mass_kg}" '
            f'diaginertia="{inertia} {inertia} 1e-9"/>'
        )
        above_m = link.length_m
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{h}" integrator="RK4" gravity="0 0 -{G}"/><worldbody>'
        f'<body><joint type="slide" axis="1 0 0"/>'
        f'<inertial pos="0 0 0" mass="{CART_KG}" diaginertia="1 1 1"/>'
        f"{bodies}{'</body>' * len(links)}</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    data.qpos[1:] = np.diff([0.0, *(link.initial_x_rad for link in links)])
    for force_n, steps in FORCES_N:
        data.qfrc_applied[0] = force_n
        for _ in range(round(steps * STEP_S / h)):
            mujoco.mj_step(model, data)
    return np.array([data.qpos[0], *np.cumsum(data.qpos[1:])])


def test_ten_seconds_of_the_case_of_the_source_agree_with_mujoco() -> None:
    """Measured: 1.5e-8 rad and 2e-11 m."""
    cart = FreeCart(CART_KG, BARS, FREE)
    for force_n, steps in FORCES_N:
        cart.advance(STEP_S, steps, force_n)
    ours = [cart.position_m, *(link.angle_x_rad for link in cart.links)]
    theirs = mujoco_motion(BARS, 5e-4)
    np.testing.assert_allclose(ours, theirs, atol=1e-7)


@pytest.mark.parametrize(
    ("cart_mass_kg", "links", "load", "text"),
    [
        (0.0, BARS, FREE, "cart_mass_kg = 0.0; must be > 0"),
        (math.nan, BARS, FREE, "cart_mass_kg = nan; must be > 0"),
        (1.0, BARS, LoadParams(damping_ratio=0.01), "use joint_damping_n_m_s_rad"),
        (
            1.0,
            [LinkParams(length_m=1.0, mass_kg=1.0, drag_n_s2_m2=0.1)],
            FREE,
            "use joint_damping_n_m_s_rad",
        ),
        (1e-6, [LinkParams(length_m=1.0, mass_kg=1.0)], FREE, "take a heavier cart"),
    ],
)
def test_a_free_cart_that_cannot_be_simulated_is_refused(
    cart_mass_kg: float, links: list[LinkParams], load: LoadParams, text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        FreeCart(cart_mass_kg, links, load)
