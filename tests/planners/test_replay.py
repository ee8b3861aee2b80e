"""Replays of the nonlinear load against an independent Lagrangian, MuJoCo, energy, impulses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.errors import PlanError
from planners.models.chain import ChainModel, Link, parse_links
from planners.models.pendulum import PendulumModel
from planners.replay import Swing, _momenta, replay
from planners.replay.several_links import play_several_links
from planners.trajectories.pieces import ExpPolynomial, ModalTerm, Smooth, polynomial
from planners.trajectories.trajectory import Trajectory
from tests.planners.lagrangian import CartAndChain

TWO = ChainModel(
    links=parse_links("0.5:3.375:bar,0.5:3.375:bar"),
    stiffness_n_m_rad=(10.0,),
    joint_damping_n_m_s_rad=(0.05,),
)
THREE = ChainModel(
    links=parse_links("0.5:3:bar,0.3:0.5:point,0.4:2:bar"),
    stiffness_n_m_rad=(4.0, 2.0),
    joint_damping_n_m_s_rad=(0.1, 0.02),
    tip_mass_kg=0.5,
)
ONE = ChainModel(links=parse_links("0.9:2.0:bar"), tip_mass_kg=0.4)
METRE = PendulumModel(length_m=1.0, damping_ratio=0.02)


def truth_of(model):
    if isinstance(model, PendulumModel):
        return CartAndChain(links=((model.length_m, model.mass_kg, "point"),))
    links = tuple((link.length_m, link.mass_kg, link.kind) for link in model.links)
    return CartAndChain(
        links=links,
        springs=model.stiffness_n_m_rad,
        dampers=model.joint_damping_n_m_s_rad,
        tip=model.tip_mass_kg,
    )


def quintic(distance_m, time_s):
    d, t = distance_m, time_s
    return polynomial(t, (0.0, 0.0, 0.0, 10 * d / t**3, -15 * d / t**4, 6 * d / t**5))


def split(piece, count):
    h = piece.duration_s / count
    return Trajectory(tuple(piece.window(k * h, h) for k in range(count)))


def general(model, trajectory, angles=None):
    """Replay any model with the integrator for several links."""
    angles = np.zeros(model.links_count) if angles is None else np.array(angles)
    momenta = _momenta(model.equations, angles, np.zeros_like(angles), 0.0)
    *_, last = play_several_links(model.equations, trajectory, angles, momenta)
    return last.angles[-1]


WAVE = ExpPolynomial(
    1.0,
    (0.0, 0.1),
    (ModalTerm(complex(-0.5, 9.0), (0.03 + 0.01j,)), ModalTerm(-40.0 + 0j, (0.01 + 0j,))),
)


def ramp(t, order):
    u = 4 * t - 1.5
    if order == 0:
        return 0.1 * np.tanh(u)
    if order == 1:
        return 0.1 * (4 / np.cosh(u) ** 2)
    return -3.2 * np.tanh(u) / np.cosh(u) ** 2


RAMP = Smooth(0.8, ramp, 2)


@pytest.mark.parametrize(
    ("model", "trajectory", "start"),
    [
        (TWO, Trajectory((quintic(0.2, 2.0),)), (0.0, 0.0, 0.0, 0.0)),
        (TWO, Trajectory((quintic(1.0, 2.0),)), (0.4, -0.3, 0.0, 0.5)),
        (TWO, split(quintic(0.5, 1.2), 20), (0.0, 0.0, 0.0, 0.0)),
        (TWO, Trajectory((WAVE, RAMP)), (0.0, 0.1, 0.0, 0.0)),
        (
            THREE,
            Trajectory((quintic(0.3, 0.8), polynomial(0.2, (0.3,)))),
            (0.5, -0.5, 1.0, 0.0, 0.0, -1.0),
        ),
        (ONE, Trajectory((quintic(1.0, 1.0), polynomial(2.0, (1.0,)))), (0.3, -0.4)),
    ],
    ids=["tables", "wild", "pieces", "modes", "three", "bar"],
)
def test_a_replay_agrees_with_scipy_on_an_independent_lagrangian(model, trajectory, start):
    n, before, after = model.links_count, 0.02, -0.1
    peak, end = truth_of(model).play(trajectory, start, (before, after))
    speeds = {"speed_before_m_s": before, "speed_after_m_s": after}
    swing = replay(model, trajectory, angles_rad=start[:n], rates_rad_s=start[n:], **speeds)
    np.testing.assert_allclose(swing.angle_rad[-1], end[:n], atol=1e-7 if n == 1 else 3e-9)
    np.testing.assert_allclose(
        swing.angular_velocity_rad_s[-1], end[n:], atol=1e-6 if n == 1 else 3e-8
    )
    assert swing.peak_rad() == pytest.approx(peak, rel=1e-6)
    assert swing.angle_rad.shape == swing.angular_velocity_rad_s.shape == (swing.t_s.size, n)
    assert (swing.t_s[0], swing.t_s[-1]) == pytest.approx((0.0, trajectory.duration_s), abs=1e-12)
    assert np.all(np.diff(swing.t_s) >= 0.0)


@settings(max_examples=12)
@given(
    angles=st.lists(st.floats(-2.5, 2.5), min_size=3, max_size=3),
    rates=st.lists(st.floats(-3, 3), min_size=3, max_size=3),
)
def test_an_undamped_load_under_a_still_platform_keeps_its_energy(angles, rates):
    model = ChainModel(links=THREE.links, stiffness_n_m_rad=(4.0, 2.0), tip_mass_kg=0.5)
    swing, truth = (
        replay(model, Trajectory.hold(0.3, 1.0), angles_rad=angles, rates_rad_s=rates),
        truth_of(model),
    )
    picked = np.linspace(0, swing.t_s.size - 1, 9).astype(int)
    states = zip(swing.angle_rad[picked], swing.angular_velocity_rad_s[picked], strict=True)
    energies = [truth.energy(np.append(0.3, th), np.append(0.0, rate)) for th, rate in states]
    assert np.ptp(energies) <= 1e-7 * max(1.0, np.abs(energies).max())


def test_a_pendulum_keeps_its_energy_for_a_minute():
    model = PendulumModel(length_m=1.0)
    swing = replay(model, Trajectory.hold(0.0, 60.0), angles_rad=[0.5])
    energy = 0.5 * swing.angular_velocity_rad_s[:, 0] ** 2 - 9.81 * np.cos(swing.angle_rad[:, 0])
    assert np.ptp(energy) <= 1e-6


@pytest.mark.parametrize("model", [METRE, ONE, TWO, THREE])
def test_a_step_in_speed_is_an_impulse_at_the_pivot(model):
    n, angles = model.links_count, np.linspace(0.3, -0.5, model.links_count)
    run = Trajectory((polynomial(1e-9, (0.0, 0.7)),))
    swing = replay(model, run, angles_rad=angles, speed_before_m_s=0.0, speed_after_m_s=0.7)
    mass = truth_of(model).mass(np.append(0.0, angles))
    kick = -np.linalg.solve(mass[1:, 1:], mass[1:, 0] * 0.7)
    np.testing.assert_allclose(
        swing.angular_velocity_rad_s, np.tile(kick, (swing.t_s.size, 1)), atol=1e-6
    )
    np.testing.assert_allclose(swing.angle_rad[-1], angles, atol=1e-8)
    back = replay(model, run, angles_rad=angles)
    np.testing.assert_allclose(back.angular_velocity_rad_s[-1], np.zeros(n), atol=1e-6)


def test_a_step_within_the_move_stands_twice_in_the_swing():
    run = Trajectory((polynomial(0.3, (0.0,)), polynomial(0.3, (0.0, 0.5))))
    for model in (METRE, TWO):
        swing = replay(model, run)
        twice = np.flatnonzero(np.isclose(swing.t_s, 0.3, atol=1e-12))
        before, after = (
            swing.angular_velocity_rad_s[twice[0], 0],
            swing.angular_velocity_rad_s[twice[-1], 0],
        )
        assert abs(before) < 1e-12
        assert after < -0.4


@pytest.mark.parametrize(("model", "alike"), [(METRE, 0.02), (PendulumModel(length_m=0.8), 0.0)])
def test_a_chain_of_one_point_swings_like_the_pendulum(model, alike):
    chain = ChainModel(links=(Link(model.length_m, 0.7, "point"),), damping_ratio=alike)
    run = Trajectory((quintic(0.5, 1.5),))
    ours, theirs = replay(chain, run, angles_rad=[0.2]), replay(model, run, angles_rad=[0.2])
    np.testing.assert_allclose(ours.angle_rad, theirs.angle_rad, atol=1e-12)


@settings(max_examples=15)
@given(
    length=st.floats(0.15, 2.0),
    zeta=st.sampled_from([0.0, 0.05, 0.5]),
    distance=st.floats(-0.6, 0.6),
    time_s=st.floats(0.8, 3.0),
    start=st.floats(-0.5, 0.5),
    count=st.sampled_from([1, 3, 60]),
)
def test_one_link_in_plain_floats_agrees_with_the_integrator_for_several(
    length, zeta, distance, time_s, start, count
):
    model, run = (
        PendulumModel(length_m=length, damping_ratio=zeta),
        split(quintic(distance, time_s), count),
    )
    fast = replay(model, run, angles_rad=start)
    np.testing.assert_allclose(fast.angle_rad[-1], general(model, run, [start]), atol=1e-7)


@pytest.mark.parametrize("model", [METRE, ONE, TWO, THREE])
@pytest.mark.parametrize("count", [7, 200])
def test_pieces_of_a_move_swing_like_the_whole(model, count):
    whole, parts = (replay(model, split(quintic(0.4, 1.6), pieces)) for pieces in (1, count))
    np.testing.assert_allclose(parts.angle_rad[-1], whole.angle_rad[-1], atol=1e-8)
    assert parts.peak_rad() == pytest.approx(whole.peak_rad(), rel=1e-7)


@pytest.mark.parametrize("model", [METRE, ONE])
def test_a_short_bent_piece_is_resolved_however_slow_the_load(model):
    run = Trajectory((quintic(0.3, 0.05), polynomial(1.0, (0.3,))))
    swing = replay(model, run)
    np.testing.assert_allclose(swing.angle_rad[-1], general(model, run), atol=1e-8)


def test_a_bent_path_peaks_between_its_steps():
    t = np.linspace(0.0, 2.0, 41)
    swing = Swing(
        t,
        np.column_stack([np.sin(t), -1.1 * np.sin(t + 0.3)]),
        np.column_stack([np.cos(t), -1.1 * np.cos(t + 0.3)]),
    )
    assert np.abs(swing.angle_rad).max() < 1.1 - 1e-5
    assert swing.peak_rad() == pytest.approx(1.1, rel=2e-8)
    still = Swing(t, np.full((41, 1), -0.2), np.zeros((41, 1)))
    assert still.peak_rad() == 0.2
    line = Swing(t[:2], np.array([[0.0], [0.05]]), np.ones((2, 1)))
    assert line.peak_rad() == pytest.approx(0.05, rel=1e-15)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (
            {"angles_rad": [0.1]},
            r"angles_rad = \[0\.1\]; must be 2 finite numbers, one for each link",
        ),
        (
            {"rates_rad_s": [0.1, math.nan]},
            r"rates_rad_s = \[0\.1, nan\]; must be 2 finite numbers",
        ),
        ({"angles_rad": [0.0, 0.0, 0.0]}, "must be 2 finite numbers"),
        (
            {"rates_rad_s": [1e9, -1e9]},
            r"the load at 0 s requires steps of .* s; must be >= .* s: check the start",
        ),
    ],
)
def test_an_invalid_start_is_refused_by_name(bad, words):
    with pytest.raises(PlanError, match=words):
        replay(TWO, Trajectory((quintic(0.2, 2.0),)), **bad)


def test_a_load_that_rotates_too_fast_is_refused():
    run = Trajectory((quintic(1e6, 0.1),))
    with pytest.raises(
        PlanError,
        match=r"the load rotates too fast in the piece that begins at 0 s, at a speed of .* m/s",
    ):
        replay(METRE, run)
    with pytest.raises(PlanError, match="requires steps of"):
        replay(TWO, run)


def test_a_load_that_tumbles_is_replayed():
    start = (2.8, 3.0, 6.0, -4.0)
    run = Trajectory((quintic(0.5, 0.5),))
    _, end = truth_of(TWO).play(run, start)
    swing = replay(TWO, run, angles_rad=start[:2], rates_rad_s=start[2:])
    np.testing.assert_allclose(swing.angle_rad[-1], end[:2], atol=1e-7)


def mjcf_of(model):
    """Write the chain as MJCF: a slide along x, hinges about -y so that positive is ahead.

    A bar is a body with its own inertia.
    """
    open_, close = "", ""
    for i, link in enumerate(model.links):
        drop = model.links[i - 1].length_m if i else 0.0
        stiffness = model.stiffness_n_m_rad[i - 1] if i else 0.0
        damping = model.joint_damping_n_m_s_rad[i - 1] if i else 0.0
        middle = link.length_m / 2 if link.kind == "bar" else link.length_m
        inertia = link.mass_kg * link.length_m**2 / 12 if link.kind == "bar" else 1e-9
        open_ += (
            f'<body pos="0 0 {-drop}">'
            f'<joint type="hinge" axis="0 -1 0" stiffness="{stiffness}" damping="{damping}"/>'
            f'<inertial pos="0 0 {-middle}" mass="{link.mass_kg}" '
            f'diaginertia="{inertia} {inertia} {inertia}"/>'
        )
        close += "</body>"
    tip = ""
    if model.tip_mass_kg:
        tip = (
            f'<body pos="0 0 {-model.links[-1].length_m}"><inertial pos="0 0 0" '
            f'mass="{model.tip_mass_kg}"  diaginertia="1e-9 1e-9 1e-9"/></body>'
        )
    return (
        '<mujoco><option timestep="0.0005" integrator="RK4" gravity="0 0 -9.81"/><worldbody><body>'
        '<joint type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1e7" diaginertia="1 1 1"/>'
        f"{open_}{tip}{close}</body></worldbody></mujoco>"
    )


@pytest.mark.parametrize("model", [TWO, THREE, ONE], ids=["two", "three", "one"])
def test_a_replay_agrees_with_mujoco(model):
    mujoco = pytest.importorskip("mujoco")
    world = mujoco.MjModel.from_xml_string(mjcf_of(model))
    data, n, time_s = mujoco.MjData(world), model.links_count, 1.5
    piece, start = quintic(0.5, time_s), np.array([0.3, -0.4, 0.5])[:n]
    data.qpos[1:] = np.diff(start, prepend=0.0)

    def push(_, data):
        # The load does not affect a cart of ten thousand tonnes.
        data.qfrc_applied[0] = 1e7 * float(piece.at(np.asarray(data.time), 2))

    mujoco.set_mjcb_control(push)
    try:
        for _ in range(round(time_s / world.opt.timestep)):
            mujoco.mj_step(world, data)
    finally:
        mujoco.set_mjcb_control(None)
    swing = replay(model, Trajectory((piece,)), angles_rad=start)
    np.testing.assert_allclose(swing.angle_rad[-1], np.cumsum(data.qpos[1:]), atol=1e-5)
    np.testing.assert_allclose(
        swing.angular_velocity_rad_s[-1], np.cumsum(data.qvel[1:]), atol=1e-4
    )
    assert data.qpos[0] == pytest.approx(0.5, abs=1e-5)
