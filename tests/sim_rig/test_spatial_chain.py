"""Load in space, against closed forms, the linear modes of planners, and MuJoCo."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ellipk

from planners.models.chain import ChainModel, Link
from sim_rig.load_params import LinkParams, LoadParams, Push
from sim_rig.params import PendulumParams
from sim_rig.pendulum import Pendulum
from sim_rig.spatial_chain import LoadEvent, SpatialChain
from sim_rig.spatial_pendulum import SpatialPendulum

FloatArray = NDArray[np.float64]
STEP_S = 1e-3
G = 9.81
FREE = LoadParams(damping_ratio=0.0)
CABLE = LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=0.3)


def links(*rows: tuple[float, float, str], **changes: float) -> list[LinkParams]:
    """Links of (length, mass, kind), each at the same initial angles."""
    return [
        LinkParams(length_m=length, mass_kg=mass, kind=kind, **changes)  # type: ignore[arg-type]
        for length, mass, kind in rows
    ]


TWO_MASSES = links((0.392, 0.35, "point"), (0.392, 0.35, "point"), initial_x_rad=0.1)
THREE_BARS = [
    LinkParams(length_m=0.5, mass_kg=3.375, kind="bar", initial_x_rad=0.3),
    LinkParams(
        length_m=0.5,
        mass_kg=3.375,
        kind="bar",
        joint_stiffness_n_m_rad=10.0,
        initial_x_rad=0.2,
        initial_y_rad=0.1,
    ),
    LinkParams(
        length_m=0.3, mass_kg=1.0, kind="bar", joint_stiffness_n_m_rad=2.0, initial_y_rad=0.2
    ),
]


@pytest.mark.parametrize(
    ("load", "bound"), [([CABLE], 1e-12), (TWO_MASSES, 1e-7), (THREE_BARS, 1e-7)]
)
def test_an_undamped_load_keeps_its_energy_for_24_s(load: list[LinkParams], bound: float) -> None:
    chain = SpatialChain(load, FREE)
    before = chain.energy_j
    chain.advance_at_rest(STEP_S, 24_000 if len(load) == 1 else 8_000)
    drift = abs(chain.energy_j / before - 1.0)
    assert drift * (1.0 if len(load) == 1 else 3.0) < bound, "8 s of several links are a third"


def test_a_planar_swing_has_the_period_of_the_elliptic_integral() -> None:
    amplitude = 0.8
    chain = SpatialChain([LinkParams(length_m=0.6, mass_kg=1.0, initial_x_rad=amplitude)], FREE)
    period_s = 4.0 * math.sqrt(0.6 / G) * float(ellipk(math.sin(amplitude / 2.0) ** 2))
    angles = []
    for _ in range(round(period_s / STEP_S) + 2):
        angles.append(chain.links[0].angle_x_rad)
        chain.advance_at_rest(STEP_S, 1)
    half = np.flatnonzero(np.diff(np.sign(angles)))
    crossings = [k + angles[k] / (angles[k] - angles[k + 1]) for k in half]
    assert (crossings[1] - crossings[0]) * STEP_S == pytest.approx(period_s / 2.0, rel=1e-6)


@pytest.mark.parametrize("tilt_rad", [0.05, 0.4, 1.0])
def test_a_conical_pendulum_turns_at_its_closed_form_rate(tilt_rad: float) -> None:
    """omega^2 = g / (l cos tilt); the tension is m g / cos tilt."""
    length_m, mass_kg = 0.8, 0.5
    turn_rad_s = math.sqrt(G / (length_m * math.cos(tilt_rad)))
    chain = SpatialChain([LinkParams(length_m=length_m, mass_kg=mass_kg)], FREE)
    s, c = math.sin(tilt_rad), math.cos(tilt_rad)
    chain.set_state([(s, 0.0, -c)], [(0.0, s * turn_rad_s, 0.0)])
    for steps in (500, 1500):
        chain.advance_at_rest(STEP_S, steps)
        time_s = 0.5 if steps == 500 else 2.0
        ((ux, uy, uz),) = chain.directions
        expected = (s * math.cos(turn_rad_s * time_s), s * math.sin(turn_rad_s * time_s), -c)
        assert (ux, uy, uz) == pytest.approx(expected, abs=1e-9)
        assert chain.tensions_n[0] == pytest.approx(mass_kg * G / c, rel=1e-6)


def test_the_plane_of_a_single_link_is_that_of_the_planar_pendulum() -> None:
    plane = Pendulum(PendulumParams(initial_swing_rad=0.2, damping_ratio=0.01))
    space = SpatialChain(
        [LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=0.2)], LoadParams(damping_ratio=0.01)
    )
    t_s = np.arange(0, 4001) * STEP_S / 2.0
    vx, vz = (0.3 * np.sin(3.0 * t_s)).tolist(), (0.1 * np.sin(5.0 * t_s)).tolist()
    plane.advance(STEP_S, vx, vz)
    space.advance(STEP_S, vx, [0.0] * len(vx), vz)
    link = space.links[0]
    assert link.angle_x_rad == pytest.approx(plane.angle_rad, abs=1e-11)
    assert link.rate_x_rad_s == pytest.approx(plane.angular_velocity_rad_s, abs=1e-11)
    assert link.angle_y_rad == 0.0
    pivot = (1.3, 0.0, -0.4)
    assert space.force_n(pivot) == pytest.approx(plane.force_n(0.7, pivot), rel=1e-9)


def test_the_fast_form_of_one_link_is_the_chain() -> None:
    link = LinkParams(length_m=0.7, mass_kg=0.9, initial_x_rad=0.3, initial_rate_y_rad_s=0.5)
    load = LoadParams(damping_ratio=0.02)
    forms: list[SpatialChain | SpatialPendulum] = [
        SpatialChain([link], load),
        SpatialPendulum(link, load),
    ]
    t_s = np.arange(0, 2001) * STEP_S / 2.0
    v = [(0.2 * np.sin(rate * t_s)).tolist() for rate in (3.0, 4.0, 5.0)]
    for form in forms:
        form.advance(STEP_S, *v)
        form.advance_at_rest(STEP_S, 700)
    chain, fast = forms
    assert fast.links[0] == pytest.approx(chain.links[0], abs=1e-13)
    pivot = (0.3, -0.2, 0.1)
    assert fast.force_n(pivot) == pytest.approx(chain.force_n(pivot), rel=1e-12)


def test_the_fast_form_goes_slack_as_the_chain_does() -> None:
    link = LinkParams(length_m=1.0, mass_kg=0.7, initial_rate_x_rad_s=5.5)
    events = []
    for form in (SpatialChain([link], FREE), SpatialPendulum(link, FREE)):
        with pytest.raises(LoadEvent) as caught:
            form.advance_at_rest(STEP_S, 2000)
        events.append(str(caught.value))
    assert events[0] == events[1]


@pytest.mark.parametrize("turned", [0.4, 1.0, 2.5])
def test_space_has_no_special_direction(turned: float) -> None:
    """Turning start and pivot about the vertical turns the motion."""

    def play(azimuth: float) -> FloatArray:
        c, s = math.cos(azimuth), math.sin(azimuth)
        chain = SpatialChain(THREE_BARS, LoadParams(damping_ratio=0.01))
        start = [(0.3, 0.1, -math.sqrt(0.9)), (0.0, 0.2, -math.sqrt(0.96)), (0.0, 0.0, -1.0)]
        turned = [(c * x - s * y, s * x + c * y, z) for x, y, z in start]
        chain.set_state(turned, [(0.0, 0.0, 0.0)] * 3)
        v = (0.2 * np.sin(4.0 * np.arange(0, 2001) * STEP_S / 2.0)).tolist()
        chain.advance(STEP_S, [c * one for one in v], [s * one for one in v], [0.0] * len(v))
        back = [(c * x + s * y, -s * x + c * y, z) for x, y, z in chain.directions]
        return np.array(back)

    np.testing.assert_allclose(play(turned), play(0.0), atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("chain", [TWO_MASSES, THREE_BARS])
def test_small_oscillations_have_the_modes_of_the_planners_model(
    chain: list[LinkParams], axis: str
) -> None:
    """Each mode shape at 10 mrad swings at its own frequency, to 1e-4."""
    model = ChainModel(
        links=tuple(Link(one.length_m, one.mass_kg, one.kind) for one in chain),
        stiffness_n_m_rad=tuple(one.joint_stiffness_n_m_rad for one in chain[1:]),
    )
    equations = model.equations
    mass = equations.mass_kg_m2
    stiffness = equations.springs_n_m_rad + np.diag(G * equations.coupling_kg_m)
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, stiffness))
    for square, shape in zip(squares, shapes.T, strict=True):
        omega_rad_s = math.sqrt(square)
        angles = 0.01 * shape / np.abs(shape).max()
        plain = SpatialChain(chain, FREE)
        flat = [(math.sin(a), 0.0, -math.cos(a)) for a in angles]
        start = flat if axis == "x" else [(0.0, x, z) for x, _, z in flat]
        plain.set_state(start, [(0.0, 0.0, 0.0)] * len(chain))
        steps = round(2.0 * math.pi / omega_rad_s / STEP_S)
        plain.advance_at_rest(STEP_S, steps)
        left_s = 2.0 * math.pi / omega_rad_s - steps * STEP_S
        for link, angle in zip(plain.links, angles, strict=True):
            seen = link.angle_x_rad if axis == "x" else link.angle_y_rad
            rate = link.rate_x_rad_s if axis == "x" else link.rate_y_rad_s
            assert seen + rate * left_s == pytest.approx(angle, abs=2e-4 * 0.01)


def test_damping_takes_the_amplitude_of_every_mode_by_its_ratio() -> None:
    ratio = 0.02
    chain = SpatialChain(
        [LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=0.01)], LoadParams(damping_ratio=ratio)
    )
    before = chain.energy_j
    omega_rad_s = math.sqrt(G)
    periods = 5
    time_s = periods * 2.0 * math.pi / (omega_rad_s * math.sqrt(1.0 - ratio**2))
    chain.advance_at_rest(time_s / 5000, 5000)
    assert chain.energy_j / before == pytest.approx(
        math.exp(-2.0 * ratio * omega_rad_s * time_s), rel=1e-4
    )


def test_friction_at_the_pivot_takes_the_same_angle_in_every_half_period() -> None:
    """A small swing loses 2 T_c / (m g l) in each half period (Coulomb)."""
    torque_n_m = 0.7 * G * 1e-3
    chain = SpatialChain(
        [LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=0.03)],
        LoadParams(damping_ratio=0.0, pivot_friction_n_m=torque_n_m),
    )
    half_s = math.pi / math.sqrt(G)
    turns = []
    for _ in range(4):
        chain.advance_at_rest(half_s / 1000, 1000)
        turns.append(abs(chain.links[0].angle_x_rad))
    lost = -np.diff([0.03, *turns])
    assert lost == pytest.approx([2e-3] * 4, rel=0.01)


def test_drag_of_the_air_takes_power_by_the_cube_of_the_speed() -> None:
    drag = 0.05
    moving = LinkParams(length_m=1.0, mass_kg=0.7, drag_n_s2_m2=drag, initial_rate_x_rad_s=2.0)
    chain = SpatialChain([moving], FREE)
    before = chain.energy_j
    chain.advance_at_rest(STEP_S, 10)
    assert before - chain.energy_j == pytest.approx(drag * 8.0 * 0.010, rel=0.01)


def test_a_push_gives_its_impulse() -> None:
    push = Push(at_s=0.1, duration_s=0.01, force_n=(7.0, 14.0, 0.0))
    chain = SpatialChain([LinkParams(length_m=1.0, mass_kg=0.7)], FREE, [push])
    chain.advance_at_rest(STEP_S, 110)
    link = chain.links[0]
    assert link.rate_x_rad_s == pytest.approx(0.1, rel=1e-3)
    assert link.rate_y_rad_s == pytest.approx(0.2, rel=1e-3)


def test_a_cable_that_goes_slack_ends_the_simulation() -> None:
    """Turned over at less than sqrt(g l) on its top, a cable does not pull."""
    chain = SpatialChain([LinkParams(length_m=1.0, mass_kg=0.7, initial_rate_x_rad_s=5.5)], FREE)
    with pytest.raises(LoadEvent, match="cable 1 of the load went slack"):
        chain.advance_at_rest(STEP_S, 2000)
    bar = LinkParams(length_m=1.0, mass_kg=0.7, kind="bar", initial_rate_x_rad_s=5.5)
    SpatialChain([bar], FREE).advance_at_rest(STEP_S, 2000)


def test_a_cable_that_is_pulled_too_hard_tears() -> None:
    """At the lowest point of a swing from 60 degrees the tension is 2 m g."""
    strong, weak = (
        LinkParams(length_m=1.0, mass_kg=0.7, initial_x_rad=math.pi / 3, breaking_n=share * 7.0 * G)
        for share in (0.201, 0.199)
    )
    SpatialChain([strong], FREE).advance_at_rest(STEP_S, 1500)
    with pytest.raises(LoadEvent, match="cable 1 of the load tore at 0"):
        SpatialChain([weak], FREE).advance_at_rest(STEP_S, 1500)


@pytest.mark.parametrize(
    ("load", "pushes", "text"),
    [
        (
            links((0.1, 0.01, "bar")) + links((0.1, 0.01, "bar"), joint_stiffness_n_m_rad=1e5),
            [],
            "lower joint_stiffness",
        ),
        ([CABLE], [Push(at_s=0.0, force_n=(1.0, 0.0, 0.0), link=2)], "must be <= 1"),
    ],
)
def test_what_cannot_be_simulated_is_named(
    load: list[LinkParams], pushes: list[Push], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        SpatialChain(load, FREE, pushes)


class Path:
    """Path of a pivot along each axis: A sin^3(w t), at rest at first."""

    def __init__(self, *rows: tuple[float, float]) -> None:
        self._size, self._rate = np.array(rows).T

    def speed(self, t_s: FloatArray) -> FloatArray:
        """Velocity (N, 3) at t_s (N,)."""
        w = np.multiply.outer(t_s, self._rate)
        return np.asarray(3.0 * self._size * self._rate * np.sin(w) ** 2 * np.cos(w))

    def acceleration(self, t_s: float) -> FloatArray:
        """Acceleration (3,) at t_s."""
        s, c = np.sin(self._rate * t_s), np.cos(self._rate * t_s)
        return np.asarray(3.0 * self._size * self._rate**2 * (2.0 * s * c**2 - s**3))


def mujoco_directions(load: list[LinkParams], path: Path, end_s: float, h: float) -> FloatArray:
    """Directions of the bars at end_s by MuJoCo (n, 3), with steps h.

    A bar is a body on a ball joint, with an inertia of 1e-9 about its own axis. The pivot is a
    heavy body that is pushed along the path, in each step by its acceleration at the middle.
    """
    mujoco = pytest.importorskip("mujoco")
    bodies, above_m = "", 0.0
    for one in load:
        inertia = one.mass_kg * one.length_m**2 / 12.0
        bodies += (
            f'<body pos="0 0 {-above_m}"><joint type="ball"/>'
            f'<inertial pos="0 0 {-one.length_m / 2}" mass="{one.mass_kg}" '
            f'diaginertia="{inertia} {inertia} 1e-9"/>'
        )
        above_m = one.length_m
    rail = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{h}" integrator="RK4" gravity="0 0 -{G}"/><worldbody>'
        f'<body>{rail}<inertial pos="0 0 0" mass="1e9" diaginertia="1e9 1e9 1e9"/>'
        f"{bodies}{'</body>' * len(load)}</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    above = np.array([1.0, 0.0, 0.0, 0.0])
    for i, one in enumerate(load):
        u = np.array([math.tan(one.initial_x_rad), math.tan(one.initial_y_rad), -1.0])
        turn = _turn_from_down(u / np.linalg.norm(u))
        data.qpos[3 + 4 * i : 7 + 4 * i] = _product(above * [1.0, -1.0, -1.0, -1.0], turn)
        above = turn
    for k in range(round(end_s / h)):
        push = path.acceleration((k + 0.5) * h) + np.array([0.0, 0.0, G])
        data.qfrc_applied[:3] = 1e9 * push
        mujoco.mj_step(model, data)
    mujoco.mj_kinematics(model, data)
    return np.array([-data.xmat[2 + i].reshape(3, 3)[:, 2] for i in range(len(load))])


def _turn_from_down(u: FloatArray) -> FloatArray:
    """Quaternion that turns (0, 0, -1) into u without spin."""
    quat = np.array([1.0 - u[2], *np.cross([0.0, 0.0, -1.0], u)])
    return np.asarray(quat / np.linalg.norm(quat))


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Product of two quaternions."""
    w = a[0] * b[0] - a[1:] @ b[1:]
    return np.array([w, *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


@pytest.mark.parametrize("driven", [False, True])
@pytest.mark.parametrize("plane", ["planar", "spatial"])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_ten_seconds_agree_with_mujoco(count: int, plane: str, driven: bool) -> None:
    across = 0.15 if plane == "spatial" else 0.0
    load = [
        LinkParams(length_m=0.5, mass_kg=1.0, kind="bar", initial_x_rad=0.25, initial_y_rad=across),
        LinkParams(length_m=0.4, mass_kg=0.8, kind="bar", initial_y_rad=-across),
        LinkParams(length_m=0.3, mass_kg=0.5, kind="bar", initial_x_rad=-0.1),
    ][:count]
    size = 1.0 if driven else 0.0
    path = Path((0.05 * size, 2.0), (0.2 * across * size, 3.0), (0.02 * size, 1.5))
    chain = SpatialChain(load, FREE)
    half_steps_s = np.arange(20_001) * STEP_S / 2.0
    chain.advance(STEP_S, *path.speed(half_steps_s).T.tolist())
    theirs = mujoco_directions(load, path, 10.0, 2.5e-4)
    np.testing.assert_allclose(np.array(chain.directions), theirs, atol=2e-5)
