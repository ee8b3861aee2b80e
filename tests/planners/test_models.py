"""Models of the load against an independent Lagrangian, published figures and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.errors import PlanError
from planners.models.augmented import augmented, check_controllable, uncontrollable
from planners.models.chain import ChainModel, Link, parse_links
from planners.models.pendulum import PendulumModel
from tests.planners.lagrangian import CartAndChain

TWO = "0.5:3.375:bar,0.5:3.375:bar"
THREE = f"{TWO},0.5:3.375:bar"
JOINT = {"stiffness_n_m_rad": (10.0,), "joint_damping_n_m_s_rad": (2.214e-4,)}
TABLES = ChainModel(
    links=parse_links(TWO), **JOINT, cart_mass_kg=19.522
)  # source 004, section 4.2 on
MIXED = ChainModel(
    links=parse_links("0.5:2.0:bar,0.3:0.4:point,0.2:1.0:bar,0.4:0.1:point,0.6:3.0:bar"),
    stiffness_n_m_rad=(4.0, 0.0, 1.5, 7.0),
    joint_damping_n_m_s_rad=(0.0, 0.2, 0.01, 0.0),
    tip_mass_kg=0.3,
)
ENTRY = {"rtol": 1e-8, "atol": 1e-8}


def truth_of(model, *, relative=False):
    links = tuple((link.length_m, link.mass_kg, link.kind) for link in model.links)
    joints = {"springs": model.stiffness_n_m_rad, "dampers": model.joint_damping_n_m_s_rad}
    more = {"tip": model.tip_mass_kg, "gravity": model.gravity_m_s2, "cart": model.cart_mass_kg}
    return CartAndChain(links=links, **joints, **more, relative=relative)


@st.composite
def chains(draw, damping=0.0):
    n = draw(st.integers(1, 5))
    link = st.builds(
        Link, st.floats(0.1, 1.0), st.floats(0.05, 5.0), st.sampled_from(["bar", "point"])
    )
    joints = st.lists(st.floats(0.0, 20.0), min_size=n - 1, max_size=n - 1).map(tuple)
    return ChainModel(
        links=tuple(draw(st.lists(link, min_size=n, max_size=n))),
        stiffness_n_m_rad=draw(joints),
        joint_damping_n_m_s_rad=tuple(0.05 * c for c in draw(joints)),
        tip_mass_kg=draw(st.sampled_from([0.0, 0.2, 2.0])),
        damping_ratio=damping,
        gravity_m_s2=draw(st.sampled_from([9.81, 1.62])),
        cart_mass_kg=draw(st.floats(1.0, 50.0)),
    )


def motions(n):
    return st.lists(st.floats(-2.0, 2.0), min_size=2 * n, max_size=2 * n).map(np.array)


def slopes_at_rest(function, size, h=1e-3):
    """Compute the Jacobian by central differences of order 4."""
    steps = [(k, c) for k, c in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0))]
    return np.array(
        [sum(c * function(k * h * e) for k, c in steps) / (12.0 * h) for e in np.eye(size)]
    ).T


@settings(max_examples=40, deadline=None)
@given(data=st.data(), model=chains(), push=st.floats(-5.0, 5.0))
def test_the_links_obey_lagranges_equations_written_from_positions(data, model, push):
    n, e = model.links_count, model.equations
    th, rate = np.split(data.draw(motions(n)), 2)
    apart = th[:, None] - th
    acceleration = truth_of(model).driven(np.append(0.0, th), np.append(0.0, rate), push)
    left = (e.mass_kg_m2 * np.cos(apart)) @ acceleration + (e.mass_kg_m2 * np.sin(apart)) @ rate**2
    left += (
        e.damping_n_m_s_rad @ rate
        + e.springs_n_m_rad @ th
        + e.gravity_m_s2 * e.coupling_kg_m * np.sin(th)
    )
    scale = np.abs(e.mass_kg_m2).max() * (1.0 + np.abs(acceleration).max())
    np.testing.assert_allclose(left, -e.coupling_kg_m * np.cos(th) * push, atol=1e-10 * scale)


@settings(max_examples=25, deadline=None)
@given(data=st.data(), model=chains(), force=st.floats(-50.0, 50.0))
def test_a_pushed_platform_obeys_them_too(data, model, force):
    n, e = model.links_count, model.equations
    th, rate = np.split(data.draw(motions(n)), 2)
    out = truth_of(model).pushed(np.append(0.0, th), np.append(0.3, rate), force)
    pull = e.coupling_kg_m @ (np.cos(th) * out[1:] - np.sin(th) * rate**2)
    assert (e.cart_mass_kg + e.load_mass_kg) * out[0] + pull == pytest.approx(
        force, abs=1e-9 * (1 + np.abs(out).max() * 20)
    )


@pytest.mark.parametrize("angles", ["absolute", "relative"])
@pytest.mark.parametrize(
    "links", [TWO, THREE, "1.0:0.7:point", "0.2:1.35:bar,0.15:1.0125:bar", "mixed"]
)
def test_the_state_spaces_linearise_the_nonlinear_motion(links, angles):
    model = MIXED
    if links != "mixed":
        n = len(parse_links(links))
        joints = {
            "stiffness_n_m_rad": (10.0, 6.0)[: n - 1],
            "joint_damping_n_m_s_rad": (0.1, 0.3)[: n - 1],
        }
        model = ChainModel(links=parse_links(links), **joints, tip_mass_kg=0.5)
    truth, n = truth_of(model, relative=angles == "relative"), model.links_count

    def split(x):
        return np.append(x[0], x[2 : 2 + n]), np.append(x[1], x[2 + n : 2 + 2 * n])

    def joined(x, acceleration, angular):
        return np.concatenate([[x[1], acceleration], x[2 + n : 2 + 2 * n], angular])

    def driven(x):
        return joined(x, x[-1], truth.driven(*split(x), x[-1]))

    def pushed(x):
        out = truth.pushed(*split(x), x[-1])
        return joined(x, out[0], out[1:])

    for name, rates in (("acceleration", driven), ("force", pushed)):
        space = model.state_space(name, angles=angles)
        np.testing.assert_allclose(
            np.hstack([space.a, space.b]), slopes_at_rest(rates, 3 + 2 * n), **ENTRY
        )
    jerk, lag_s = model.state_space("jerk", lag_s=0.05, angles=angles), 0.05
    filtered = slopes_at_rest(
        lambda x: np.append(driven(x[:-1]), (x[-1] - x[-2]) / lag_s), 4 + 2 * n
    )
    np.testing.assert_allclose(np.hstack([jerk.a, jerk.b]), filtered, **ENTRY)


def test_the_pendulum_has_the_sources_matrices():
    model, g, big, small = PendulumModel(length_m=0.8), 9.81, 32.0, 0.7
    force = model.state_space("force")
    np.testing.assert_allclose(
        force.a[[1, 3], 2], [small * g / big, -g * (big + small) / (big * 0.8)], rtol=1e-13
    )
    np.testing.assert_allclose(force.b[[1, 3], 0], [1 / big, -1 / (big * 0.8)], rtol=1e-13)
    assert force.input == "force_n"
    jerk = model.state_space("jerk")
    assert jerk.states == (
        "position_m",
        "speed_m_s",
        "angle_rad",
        "angular_velocity_rad_s",
        "acceleration_m_s2",
    )
    assert (jerk.a[1, 4], jerk.a[4, 4], jerk.b[4, 0]) == pytest.approx(
        (1.0, -20 * math.pi, 20 * math.pi), rel=1e-14
    )
    assert jerk.a[3, [2, 4]] == pytest.approx([-g / 0.8, -1 / 0.8], rel=1e-14)


def test_the_states_of_a_chain_are_numbered_from_the_platform():
    assert TABLES.state_space(angles="relative").states == (
        *("position_m", "speed_m_s", "angle_1_rad", "relative_angle_2_rad"),
        *("angular_velocity_1_rad_s", "relative_angular_velocity_2_rad_s"),
    )
    assert TABLES.state_space().states[2:4] == ("angle_1_rad", "angle_2_rad")


@pytest.mark.parametrize(
    ("links", "tip", "cart", "printed_hz", "rel"),
    [
        (TWO, 0.0, "free", [0.675077, 2.645602], 1e-6),
        (TWO, 0.0, "driven", [0.607958, 2.594118], 1e-6),
        ("0.2:1.35:bar,0.15:1.0125:bar", 0.0, "free", [1.075789, 11.082534], 1e-6),
        ("0.2:1.35:bar,0.15:1.0125:bar", 0.0, "driven", [1.03142, 11.0227], 3e-6),
        (THREE, 0.0, "driven", [0.493814, 1.585416, 3.589785], 1e-6),
        (THREE, 1.0, "driven", [0.474549, 1.507157, 3.515032], 1e-6),
    ],
)
def test_the_bars_have_the_computed_frequencies(links, tip, cart, printed_hz, rel):
    n = len(parse_links(links)) - 1
    joints = {"stiffness_n_m_rad": (10.0,) * n, "joint_damping_n_m_s_rad": (2.214e-4,) * n}
    model = ChainModel(links=parse_links(links), **joints, tip_mass_kg=tip, cart_mass_kg=19.5222)
    np.testing.assert_allclose(model.modes(cart).natural_frequencies_hz, printed_hz, rtol=rel)


def test_the_joints_damper_damps_the_modes_as_computed():
    np.testing.assert_allclose(TABLES.modes().damping_ratios, [2.3e-7, 1.103e-4], rtol=6e-3)


def test_two_equal_masses_swing_in_the_measured_ratio():
    model = ChainModel(links=parse_links("0.392:0.35:point,0.392:0.35:point"))
    slow, fast = model.modes().natural_frequencies_hz
    assert (slow, fast) == pytest.approx((0.6095, 1.4715), rel=3e-4)
    assert fast / slow == pytest.approx(
        math.sqrt((2 + math.sqrt(2)) / (2 - math.sqrt(2))), rel=1e-12
    )


def test_a_force_sees_a_stiffer_load_than_an_acceleration():
    model = PendulumModel(length_m=1.0)
    w = 2 * math.pi * model.modes("free").natural_frequencies_hz[0]
    assert w == pytest.approx(math.sqrt(9.81 * 32.7 / 32.0), rel=1e-12)
    assert model.natural_frequency_rad_s == pytest.approx(math.sqrt(9.81), rel=1e-14)
    whole = TABLES.state_space("force")
    np.testing.assert_allclose(
        sorted(set(np.abs(np.linalg.eigvals(whole.a).imag).round(6)))[1:],
        2 * math.pi * TABLES.modes("free").natural_frequencies_hz,
        atol=1e-5,
    )


@settings(max_examples=30, deadline=None)
@given(model=chains(), zeta=st.floats(1e-5, 0.9))
def test_the_damping_ratio_is_that_of_every_mode(model, zeta):
    free = ChainModel(
        links=model.links, stiffness_n_m_rad=model.stiffness_n_m_rad, tip_mass_kg=model.tip_mass_kg
    )
    damped = free.with_parameter("damping_ratio", zeta)
    np.testing.assert_allclose(damped.modes().damping_ratios, zeta, rtol=1e-7)
    np.testing.assert_allclose(
        damped.modes().natural_frequencies_hz, free.modes().natural_frequencies_hz, rtol=1e-7
    )
    assert not free.modes().eigenvalues_1_s.real.any()


@pytest.mark.parametrize("zeta", [0.0, 0.03, 0.7])
def test_a_chain_of_one_point_is_the_pendulum(zeta):
    point = ChainModel(links=parse_links("0.8:0.7:point"), damping_ratio=zeta)
    cable = PendulumModel(length_m=0.8, damping_ratio=zeta)
    for ours, theirs in zip(point.equations, cable.equations, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-14)
    for name in ("acceleration", "force", "jerk"):
        ours, theirs = point.state_space(name), cable.state_space(name)
        assert (ours.states, ours.input) == (theirs.states, theirs.input)
        np.testing.assert_allclose(ours.a, theirs.a, rtol=1e-13)
        np.testing.assert_allclose(ours.b, theirs.b, rtol=1e-13)


def test_a_hanging_bar_swings_like_a_cable_of_two_thirds():
    bar = ChainModel(links=parse_links("0.6:2.0:bar"))
    assert bar.natural_frequency_rad_s == pytest.approx(
        PendulumModel(length_m=0.4).natural_frequency_rad_s, rel=1e-14
    )


@settings(max_examples=30, deadline=None)
@given(model=chains(), name=st.sampled_from(["acceleration", "force", "jerk"]))
def test_relative_angles_swing_at_the_same_rates(model, name):
    absolute, relative = model.state_space(name), model.state_space(name, angles="relative")
    for power in (
        1,
        2,
        3,
        4,
    ):  # sums of powers of the eigenvalues: defective double zeros do not blur them
        traces = [
            np.trace(np.linalg.matrix_power(space.a, power)) for space in (absolute, relative)
        ]
        scale = np.linalg.norm(relative.a, 2) ** power
        assert traces[0] == pytest.approx(traces[1], abs=1e-11 * scale)


@settings(max_examples=40, deadline=None)
@given(
    model=chains(), cart=st.sampled_from(["driven", "free"]), zeta=st.sampled_from([0.0, 0.01, 0.3])
)
def test_the_modes_decouple_the_swing(model, cart, zeta):
    model = model.with_parameter("damping_ratio", zeta)
    modes, (a, b) = model.modes(cart), model.equations.swing(cart)
    size = len(a)
    condition = np.linalg.cond(modes.mode_shapes)
    tolerance = 1e-13 * condition * np.abs(modes.eigenvalues_1_s).max()
    np.testing.assert_allclose(
        modes.left_eigenvectors @ modes.mode_shapes, np.eye(size), atol=1e-12 * condition
    )
    np.testing.assert_allclose(
        modes.mode_shapes @ (modes.eigenvalues_1_s[:, None] * modes.left_eigenvectors),
        a,
        atol=tolerance * np.abs(a).max(),
    )
    heard = modes.gains > 1e-9
    np.testing.assert_allclose((modes.left_eigenvectors @ b)[heard], 1.0, atol=1e-9)
    assert np.all((modes.gains >= 0.0) & (modes.gains <= 1.0 + 1e-12))
    assert np.all(np.diff(modes.natural_frequencies_hz) >= -1e-9)


def test_a_mode_that_the_platform_does_not_excite_has_no_gain():
    free, stiff = (
        ChainModel(links=parse_links(TWO), stiffness_n_m_rad=(k,)).modes().gains for k in (0.0, 1e7)
    )
    assert free.min() > 1e-2
    assert stiff[2:].max() < 1e-3 < stiff[:2].min()


@settings(max_examples=25, deadline=None)
@given(data=st.data(), model=chains())
def test_no_free_swing_exceeds_its_amplitude(data, model):
    x = 0.1 * data.draw(motions(model.links_count))
    bare = ChainModel(
        links=model.links, stiffness_n_m_rad=model.stiffness_n_m_rad, tip_mass_kg=model.tip_mass_kg
    )
    n, modes = model.links_count, bare.modes()
    t = np.linspace(0.0, 20.0, 2001)
    waves = np.exp(np.outer(t, modes.eigenvalues_1_s)) * (modes.left_eigenvectors @ x)
    angles = (waves @ modes.mode_shapes.T).real[:, :n]
    bound = bare.amplitude_rad(x[:n], x[n:])
    assert np.abs(angles).max() <= bound * (1.0 + 1e-9) + 1e-12
    if n == 1:
        w = bare.natural_frequency_rad_s
        assert bound == pytest.approx(math.hypot(x[0], x[1] / w), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    "model",
    [PendulumModel(length_m=0.7), ChainModel(links=parse_links("0.5:1:bar")), TABLES, MIXED],
)
def test_every_parameter_can_be_another(model):
    assert model.parameters
    for name, value in model.parameters.items():
        other = model.with_parameter(name, 1.01 * value + 0.001)
        assert other.parameters[name] == pytest.approx(1.01 * value + 0.001, rel=1e-15)
        changed = {key for key, was in model.parameters.items() if other.parameters[key] != was}
        bar = name.startswith("length") and name.replace("length", "mass") in changed
        assert changed == {name, name.replace("length", "mass")} if bar else {name}
        back = other.with_parameter(name, value)
        assert list(back.parameters.values()) == pytest.approx(
            list(model.parameters.values()), rel=1e-13
        )


def test_a_longer_bar_is_heavier_and_a_longer_cable_is_not():
    assert Link(0.5, 2.0, "bar").resized(0.75) == Link(0.75, 3.0, "bar")
    assert Link(0.5, 2.0, "point").resized(0.75) == Link(0.75, 2.0, "point")


def test_links_are_read_from_text():
    assert parse_links("0.5:3.375:bar, 0.3:1:point,0.2:2") == (
        Link(0.5, 3.375),
        Link(0.3, 1.0, "point"),
        Link(0.2, 2.0),
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "",
            r"link = ''; must be length:mass:kind in m and kg, kind one of bar, point: "
            r"e\.g\. 0\.5:3\.375:bar",
        ),
        ("0.5", r"link = '0\.5'; must be length:mass:kind"),
        ("0.5:1:bar,", "link = ''"),
        ("0.5:1:bar:2", "link = '0.5:1:bar:2'; must be"),
        ("half:1:bar", "link = 'half:1:bar'; must be"),
        ("0.5:1:baar", "kind of a link = 'baar'; did you mean 'bar'"),
        ("nan:1:bar", "length_m of a link = nan; must be 0.001 to 10000: measure it"),
        ("0.5:-1:bar", r"mass_kg of a link = -1\.0; must be 1e-06 to 1e\+09"),
        ("inf:1:bar", "length_m of a link = inf"),
        ("0.5:0:bar", r"mass_kg of a link = 0\.0"),
    ],
)
def test_invalid_links_are_refused_by_name(text, words):
    with pytest.raises(PlanError, match=words):
        parse_links(text)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
@pytest.mark.parametrize(
    "name",
    [
        "stiffness_n_m_rad",
        "joint_damping_n_m_s_rad",
        "tip_mass_kg",
        "damping_ratio",
        "gravity_m_s2",
        "cart_mass_kg",
    ],
)
def test_an_invalid_chain_is_refused_by_name(name, bad):
    value = (bad,) if name in JOINT else bad
    with pytest.raises(
        PlanError, match=rf"{name} = \(?{bad}.*; must be (>= 0 and < 1|[\d.e+-]+ to [\d.e+-]+): \w+"
    ):
        ChainModel(links=parse_links(TWO), **{name: value})


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
@pytest.mark.parametrize(
    "name", ["length_m", "damping_ratio", "gravity_m_s2", "mass_kg", "cart_mass_kg"]
)
def test_an_invalid_pendulum_is_refused_by_name(name, bad):
    with pytest.raises(
        PlanError, match=rf"{name} = {bad}; must be (>= 0 and < 1|[\d.e+-]+ to [\d.e+-]+): \w+"
    ):
        PendulumModel(**{"length_m": 1.0, name: bad})


def test_a_wrong_count_is_refused_with_the_right_one():
    with pytest.raises(PlanError, match="links: 0; must be 1 to 20"):
        ChainModel(links=())
    with pytest.raises(PlanError, match="links: 21; must be 1 to 20"):
        ChainModel(links=(Link(0.1, 1.0),) * 21)
    with pytest.raises(
        PlanError,
        match="stiffness_n_m_rad: 2 values; must be 1, one for each joint between 2 links",
    ):
        ChainModel(links=parse_links(TWO), stiffness_n_m_rad=(1.0, 2.0))


def test_unknown_names_are_answered_with_the_nearest():
    with pytest.raises(PlanError, match=r"parameter = 'length_3'; did you mean 'length_[12]'"):
        TABLES.with_parameter("length_3", 1.0)
    with pytest.raises(PlanError, match="parameter = 'lenth'; did you mean 'length'"):
        PendulumModel(length_m=1.0).with_parameter("lenth", 1.0)
    with pytest.raises(PlanError, match="input = 'forse'; did you mean 'force'"):
        TABLES.state_space("forse")


def simulated(space, t, inputs):
    """Compute the states at the times t for inputs held between them: (N, n)."""
    from scipy.linalg import expm

    n, h = len(space.states), t[1] - t[0]
    flow = expm(h * np.block([[space.a, space.b], [np.zeros((1, n + 1))]]))
    x = [np.zeros(n)]
    for u in inputs[:-1]:
        x.append(flow[:n, :n] @ x[-1] + flow[:n, n] * u)
    return np.array(x)


@pytest.mark.parametrize("input", ["acceleration", "force", "jerk"])
@pytest.mark.parametrize(
    ("model", "name", "h"),
    [
        (PendulumModel(length_m=0.8, damping_ratio=0.02), "length", 1e-3),
        (PendulumModel(length_m=0.8), "gravity", 1e-2),
        (TABLES, "length_2", 1e-3),
        (TABLES, "stiffness_1", 1e-2),
        (TABLES, "joint_damping_1", 1e-5),
        (MIXED, "mass_3", 1e-3),
    ],
)
@pytest.mark.parametrize("states", ["angles", "all"])
def test_the_sensitivity_states_are_the_derivatives_of_the_response(model, name, h, input, states):
    t = np.linspace(0.0, 2.0, 81)
    u = np.sin(3.0 * t) + (t < 0.5)
    value, space = model.parameters[name], augmented(model, input, [name], states=states)
    out, plain = simulated(space, t, u), len(model.state_space(input).states)
    runs = [
        simulated(model.with_parameter(name, value + k * h).state_space(input), t, u)
        for k in (-2, -1, 1, 2)
    ]
    slope = (runs[0] - 8 * runs[1] + 8 * runs[2] - runs[3]) / (12 * h)
    for k, state in enumerate(space.states[plain:]):
        x = model.state_space(input).states.index(state.removesuffix(f"_per_{name}"))
        np.testing.assert_allclose(out[:, plain + k], slope[:, x], atol=2e-7 * np.abs(slope).max())
    np.testing.assert_allclose(
        out[:, :plain], simulated(model.state_space(input), t, u), atol=1e-12
    )


def test_the_pendulums_sensitivity_to_length_is_the_sources_and_the_term_it_lacks():
    space, g, length = augmented(PendulumModel(length_m=0.8), "acceleration", ["length"]), 9.81, 0.8
    assert space.states[4:] == ("angle_rad_per_length", "angular_velocity_rad_s_per_length")
    np.testing.assert_allclose(
        space.a[4:], [[0, 0, 0, 0, 0, 1], [0, 0, g / length**2, 0, -g / length, 0]], atol=1e-9
    )
    np.testing.assert_allclose(space.b[4:, 0], [0.0, 1 / length**2], atol=1e-9)


@pytest.mark.parametrize("name", ["damping_ratio", "tip_mass", "stiffness_1", "joint_damping_1"])
def test_a_parameter_at_zero_has_a_slope_too(name):
    model, h = ChainModel(links=parse_links(TWO)), 1e-6
    at = model.state_space("force")
    beyond = [model.with_parameter(name, k * h).state_space("force") for k in (1, 2)]
    space = augmented(model, "force", [name])
    expected = (-3 * at.a + 4 * beyond[0].a - beyond[1].a) / (2 * h)
    np.testing.assert_allclose(space.a[6:, :6], expected[2:], atol=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("input", ["acceleration", "force", "jerk"])
@pytest.mark.parametrize(
    ("model", "name"),
    [(PendulumModel(length_m=1.0), "length"), (TABLES, "length_2"), (MIXED, "mass_1")],
)
def test_the_sensitivities_of_angles_are_controllable_and_those_of_positions_are_not(
    model, name, input
):
    assert check_controllable(augmented(model, input, [name]))
    with pytest.raises(
        PlanError,
        match=r"states are uncontrollable .*; must be 0 for .*: "
        r"take the sensitivities of the angles alone",
    ):
        check_controllable(augmented(model, input, [name], states="all"))
    expected = (f"position_m_per_{name}", f"speed_m_s_per_{name}")
    if input != "force":
        assert uncontrollable(augmented(model, input, [name], states="all")) == expected
    assert not uncontrollable(model.state_space(input))


@pytest.mark.parametrize(
    ("model", "names"),
    [(PendulumModel(length_m=1.0), ("length", "gravity")), (TABLES, ("length_1", "stiffness_1"))],
)
def test_a_second_parameter_adds_uncontrollable_sensitivities(model, names):
    space = augmented(model, "acceleration", names)
    assert len(space.states) == 2 + 6 * model.links_count
    assert {state for state in uncontrollable(space) if "_per_" in state} == set(
        space.states[2 + 2 * model.links_count :]
    )
    columns = [space.b]
    for _ in space.states[1:]:
        columns.append(space.a @ columns[-1] / 10.0)
    columns = np.hstack(columns) / np.linalg.norm(np.hstack(columns), axis=0)
    assert np.linalg.matrix_rank(columns, tol=1e-9) == 2 + 4 * model.links_count


def test_parameters_without_effect_are_refused_by_name():
    model = PendulumModel(length_m=1.0)
    with pytest.raises(PlanError, match="parameter = 'lenght'; did you mean 'length'"):
        augmented(model, "acceleration", ["lenght"])
    for name in ("mass", "cart_mass"):
        with pytest.raises(
            PlanError, match=f"parameter = '{name}' has no effect under input = 'acceleration'"
        ):
            augmented(model, "acceleration", [name])
        assert not uncontrollable(augmented(model, "force", [name]))
    with pytest.raises(
        PlanError, match=r"parameters = \('length', 'length'\); each must be there once"
    ):
        augmented(model, "acceleration", ["length", "length"])


@pytest.mark.parametrize("zeta", [0.0, 0.9995])
def test_a_parameter_at_the_edge_of_its_range_has_a_one_sided_derivative(zeta):
    model = PendulumModel(length_m=1.0, damping_ratio=zeta)
    space = augmented(model, "acceleration", ["damping_ratio"])
    np.testing.assert_allclose(space.a[5, 3], -2.0 * math.sqrt(9.81), rtol=1e-9)
