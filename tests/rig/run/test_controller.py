"""The controller task: bumpless arming, the setpoint grid, and stale inputs."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms.messages import (
    Command,
    JointState,
    Message,
    Phase,
    Position,
    Reference,
    Reply,
    RobotState,
    Setpoint,
    Space,
    Verb,
    axis_state,
)
from comms.task import NO_STEP, Step
from rig.run.tasks.controller.task import (
    DEFAULT_ENVELOPE,
    ControllerSettings,
    ControllerTask,
    build,
)
from rig.run.tasks.safety import Envelope

MS = 1_000_000
TICK_NS = 5 * MS
T_START_NS = 600 * MS
STALE_NS = 300 * MS
NO_BOUNDS = Envelope(
    position_min_m=-10,
    position_max_m=10,
    depth_m=10,
    height_m=10,
    speed_m_s=1e3,
    acceleration_m_s2=1e6,
)
PARKED = (0.05, 0.01, -0.02)


def order(verb: Verb, t_ns: int = 0, id: int = 7) -> Command:
    """Order of the operator."""
    t_start_ns = T_START_NS if verb is Verb.START else 0
    return Command(seq=0, t_ns=t_ns, id=id, to="controller", verb=verb, t_start_ns=t_start_ns)


def joints(t_ns: int, position_m: Position = PARKED) -> JointState:
    """Joint state from the encoders."""
    return axis_state(0, t_ns, position_m, (0.1, 0.2, 0.3))


def reference(x_m: float, t_target_ns: int) -> Reference:
    """Reference at a position along X."""
    return Reference(
        seq=0, t_ns=t_target_ns, t_target_ns=t_target_ns, position_m=(x_m, 0.01, -0.02)
    )


def tell(controller: ControllerTask, message: Message, t_ns: int) -> Step:
    """Pass a message to the task."""
    return controller.on_message("-", message, t_ns)


def replies(step: Step) -> list[Reply]:
    """Answers and reports of a step."""
    return [send.message for send in step.sends if isinstance(send.message, Reply)]


def setpoints(step: Step) -> list[Setpoint]:
    """Setpoints of a step."""
    return [send.message for send in step.sends if isinstance(send.message, Setpoint)]


def after(*verbs: Verb, envelope: Envelope = NO_BOUNDS) -> ControllerTask:
    """Controller with a joint state, after these orders at 600 ms, t_start."""
    settings = ControllerSettings(reference_stale_ns=STALE_NS, policy="source", envelope=envelope)
    controller = ControllerTask(settings)
    controller.start(T_START_NS - TICK_NS)
    tell(controller, joints(T_START_NS), T_START_NS)
    for verb in verbs:
        (reply,) = replies(tell(controller, order(verb), T_START_NS))
        assert reply.ok, reply.text
    return controller


def run(
    controller: ControllerTask,
    ticks: range,
    refer: Callable[[int], float | None] = lambda k: None,
    encoders: bool = True,
) -> list[Step]:
    """Ticks from t_start on; before each, a joint state, and a reference if refer(k) gives one."""
    steps = []
    for k in ticks:
        t_ns = T_START_NS + k * TICK_NS
        if encoders:
            tell(controller, joints(t_ns), t_ns)
        x_m = refer(k)
        if x_m is not None:
            tell(controller, reference(x_m, t_ns), t_ns)
        steps.append(controller.on_tick(t_ns))
    return steps


def xs(steps: list[Step]) -> list[float]:
    """X of all setpoints [m]."""
    return [s.position_m[0] for step in steps for s in setpoints(step)]


def news(steps: list[Step]) -> list[Reply]:
    """Answers and reports of all steps."""
    return [r for step in steps for r in replies(step)]


@pytest.mark.parametrize("t_ns", [0, 1, TICK_NS - 1, TICK_NS, 123_456_789])
def test_the_first_wake_is_the_next_instant_of_the_grid_of_the_run_clock(t_ns: int) -> None:
    wake_ns = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS)).start(t_ns).wake_ns
    assert wake_ns is not None
    assert wake_ns % TICK_NS == 0
    assert t_ns < wake_ns <= t_ns + TICK_NS


@given(lateness=st.lists(st.integers(0, 4 * TICK_NS), min_size=1, max_size=40))
def test_a_late_wake_keeps_the_grid_and_counts_the_skipped_ticks(
    lateness: list[int],
) -> None:
    controller = after(Verb.ARM)
    due_ns, served = T_START_NS, 0
    for late_ns in lateness:
        tell(controller, joints(due_ns), due_ns + late_ns)
        step = controller.on_tick(due_ns + late_ns)
        served += 1
        assert len(setpoints(step)) == 1, "late ticks are never made up"
        assert step.wake_ns is not None
        assert step.wake_ns % TICK_NS == 0
        assert due_ns + late_ns < step.wake_ns <= due_ns + late_ns + TICK_NS
        due_ns = step.wake_ns
    assert controller.late_ticks == (due_ns - T_START_NS) // TICK_NS - served


def test_arming_commands_exactly_where_the_robot_stands() -> None:
    steps = run(after(Verb.ARM), range(20))
    assert {s.position_m for step in steps for s in setpoints(step)} == {PARKED}


def test_arming_does_not_follow_the_robot_afterwards() -> None:
    controller = after(Verb.ARM)
    tell(controller, joints(T_START_NS, (0.2, 0.2, 0.2)), T_START_NS)
    assert setpoints(controller.on_tick(T_START_NS))[0].position_m == PARKED


def test_the_first_window_leaves_from_where_the_robot_stands() -> None:
    got = xs(run(after(Verb.ARM, Verb.START), range(6), lambda k: 0.056))
    assert got == [pytest.approx(0.05 + 0.001 * k) for k in range(1, 7)]


def test_no_setpoint_leaves_before_arming() -> None:
    assert xs(run(after(), range(20), lambda k: 0.1)) == []


def test_armed_it_ignores_references_and_started_too_until_t_start() -> None:
    assert set(xs(run(after(Verb.ARM), range(20), lambda k: 0.1))) == {0.05}
    early = after(Verb.ARM, Verb.START)
    assert set(xs(run(early, range(-20, 0), lambda k: 0.1))) == {0.05}


def test_setpoints_leave_at_every_tick_and_the_state_at_every_other_one_to_both_listeners() -> None:
    steps = run(after(Verb.ARM), range(20))
    assert [len(setpoints(step)) for step in steps] == [1] * 20
    channels = [
        [send.channel for send in step.sends if isinstance(send.message, RobotState)]
        for step in steps
    ]
    assert channels == [["robot_state", "platform_1"], []] * 10


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_the_state_goes_to_the_streamer_and_to_the_vision_task_of_every_camera(count: int) -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS, cameras=count))
    controller.start(T_START_NS - TICK_NS)
    (step,) = run(controller, range(1))
    channels = [send.channel for send in step.sends if isinstance(send.message, RobotState)]
    assert channels == ["robot_state", *["platform_1", "platform_2", "platform_3"][:count]]


def test_setpoints_and_states_are_counted_without_a_gap() -> None:
    steps = run(after(Verb.ARM), range(20))
    assert [s.seq for step in steps for s in setpoints(step)] == list(range(20))
    for channel in ("robot_state", "platform_1"):
        counts = [
            send.message.seq for step in steps for send in step.sends if send.channel == channel
        ]
        assert counts == list(range(10))


def test_a_status_order_in_mid_move_changes_nothing() -> None:
    controller, undisturbed = after(Verb.ARM, Verb.START), after(Verb.ARM, Verb.START)
    run(controller, range(3), lambda k: 0.056)
    assert replies(tell(controller, order(Verb.STATUS), T_START_NS + 11 * MS))[0].ok
    assert (
        xs(run(controller, range(3, 20), lambda k: 0.06))
        == xs(run(undisturbed, range(20), lambda k: 0.056 if k < 3 else 0.06))[3:]
    )


def test_the_state_says_what_is_commanded_and_what_the_encoders_read_and_when() -> None:
    controller = after(Verb.ARM)
    tell(controller, joints(T_START_NS - 3 * MS, (0.06, 0.0, 0.0)), T_START_NS)
    (state, _) = [
        send.message
        for send in controller.on_tick(T_START_NS).sends
        if isinstance(send.message, RobotState)
    ]
    assert (state.commanded_m, state.actual_m) == (PARKED, (0.06, 0.0, 0.0))
    assert (state.t_ns, state.t_actual_ns) == (T_START_NS, T_START_NS - 3 * MS)
    assert (state.actual_velocity_m_s, state.phase) == ((0.1, 0.2, 0.3), Phase.ARMED)


def test_before_arming_the_state_commands_where_the_robot_stands() -> None:
    (step,) = run(after(), range(1))
    states = [send.message for send in step.sends if isinstance(send.message, RobotState)]
    assert [s.commanded_m for s in states] == [PARKED, PARKED]


def test_no_state_is_sent_before_the_first_joint_state() -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS))
    controller.start(0)
    assert [controller.on_tick(k * TICK_NS).sends for k in range(1, 5)] == [()] * 4


@pytest.mark.parametrize("verb", [Verb.STATUS, Verb.ARM])
def test_a_controller_without_encoders_refuses_to_say_it_is_ready_or_to_arm(verb: Verb) -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS))
    controller.start(0)
    (reply,) = replies(tell(controller, order(verb, id=12), 0))
    assert (reply.id, reply.ok, reply.phase) == (12, False, Phase.IDLE)
    assert reply.text == (
        "no joint state arrives from the encoders; see bench.log in the folder of the run"
    )


@pytest.mark.parametrize(("age_ms", "ok"), [(100, True), (101, False)])
def test_arming_needs_encoders_heard_within_100_ms(age_ms: int, ok: bool) -> None:
    (reply,) = replies(tell(after(), order(Verb.ARM), T_START_NS + age_ms * MS))
    assert reply.ok is ok


@pytest.mark.parametrize(
    ("history", "verb"),
    [
        pytest.param([], Verb.START, id="start_without_arm"),
        pytest.param([Verb.ARM, Verb.START], Verb.START, id="start_twice"),
        pytest.param([Verb.ARM, Verb.START], Verb.ARM, id="arm_while_running"),
        pytest.param([Verb.STOP], Verb.ARM, id="arm_after_stop"),
        pytest.param([Verb.ARM, Verb.STOP], Verb.START, id="start_after_stop"),
        pytest.param([Verb.ARM, Verb.ESTOP], Verb.ARM, id="arm_after_estop"),
    ],
)
def test_an_order_that_does_not_fit_the_phase_is_refused_and_changes_nothing(
    history: list[Verb], verb: Verb
) -> None:
    controller, untouched = after(*history), after(*history)
    (reply,) = replies(tell(controller, order(verb), T_START_NS))
    assert not reply.ok
    assert f"{verb.value} refused: {reply.phase.value}; must be" in reply.text
    assert xs(run(controller, range(12), lambda k: 0.06)) == xs(
        run(untouched, range(12), lambda k: 0.06)
    )


def test_only_the_newest_reference_counts_whatever_the_order_of_arrival() -> None:
    controller = after(Verb.ARM, Verb.START)
    for x_m, age_ms in ((0.02, 20), (0.056, 0), (0.03, 10)):
        tell(controller, reference(x_m, T_START_NS - age_ms * MS), T_START_NS)
    assert xs(run(controller, range(6)))[-1] == pytest.approx(0.056)


def test_a_gap_in_the_references_is_held_and_then_caught_up() -> None:
    got = xs(
        run(
            after(Verb.ARM, Verb.START),
            range(42),
            lambda k: 0.05 if k < 12 else 0.056 if k >= 30 else None,
        )
    )
    assert got[:30] == [pytest.approx(0.05)] * 30
    assert got[30:36] == [pytest.approx(0.05 + 0.001 * k) for k in range(1, 7)]


def test_stale_references_stop_the_robot_where_it_is_with_exit_5() -> None:
    controller = after(Verb.ARM, Verb.START)
    run(controller, range(8), lambda k: 0.056)
    steps = run(controller, range(8, 100))
    (report,) = news(steps)
    silent_for = next(k for k, step in enumerate(steps, 8) if replies(step)) - 7
    assert silent_for == STALE_NS // TICK_NS + 1  # 300 ms are still good
    assert (report.id, report.ok, report.exit, report.phase) == (0, False, 5, Phase.STOPPED)
    assert "no reference for 305 ms; must be <= 300 ms (safety.reference_stale_ms)" in report.text
    assert xs(steps) == [pytest.approx(0.056)] * len(steps)


def test_missing_references_are_detected_from_t_start_on() -> None:
    controller = after(Verb.ARM, Verb.START)
    assert news(run(controller, range(STALE_NS // TICK_NS + 1))) == []
    (report,) = news(run(controller, range(STALE_NS // TICK_NS + 1, STALE_NS // TICK_NS + 2)))
    assert report.exit == 5


def test_after_a_stale_stop_new_references_move_nothing() -> None:
    controller = after(Verb.ARM, Verb.START)
    run(controller, range(70), lambda k: 0.056 if k < 6 else None)
    assert xs(run(controller, range(70, 100), lambda k: 0.2)) == [pytest.approx(0.056)] * 30


@pytest.mark.parametrize("verbs", [(Verb.ARM,), (Verb.ARM, Verb.START)], ids=["armed", "running"])
def test_silent_encoders_are_a_fault_after_100_ms(verbs: tuple[Verb, ...]) -> None:
    steps = run(after(*verbs), range(40), lambda k: 0.06, encoders=False)
    ((k, report),) = [(k, r) for k, step in enumerate(steps) for r in replies(step)]
    assert k == 21
    assert (report.id, report.ok, report.exit, report.phase) == (0, False, 5, Phase.FAULT)
    assert report.text == (
        "no joint state for 105 ms; must be <= 100 ms (safety.robot_stale_ms): "
        "nothing arrived from the bench"
    )
    assert len(set(xs(steps[k:]))) == 1, "the setpoint stays where it is"


def test_silent_encoders_before_arming_are_no_fault() -> None:
    assert news(run(after(), range(100), encoders=False)) == []


OTHER_ROBOT = "must be x, y, z in m: the robot of the bench is not that of the controller"
OTHER_JOINTS = [
    pytest.param(Space.RADIANS, 6, "joint states of 6 joints in rad", id="six_in_rad"),
    pytest.param(Space.RADIANS, 3, "joint states of 3 joints in rad", id="three_in_rad"),
    pytest.param(Space.METRES, 2, "joint states of 2 joints in m", id="two_in_m"),
]


def other_joints(t_ns: int, space: Space = Space.RADIANS, count: int = 6) -> JointState:
    """Joint state of a robot whose joints are not the axes x, y, z in m."""
    values = (*[0.3] * count, *[0.0] * (6 - count))
    return JointState(seq=0, t_ns=t_ns, space=space, count=count, values=values, rates=values)


def run_with_other_joints(controller: ControllerTask, ticks: range) -> list[Step]:
    """Ticks from t_start on; before each, a reference and joint states of another robot."""
    steps = []
    for k in ticks:
        t_ns = T_START_NS + k * TICK_NS
        tell(controller, other_joints(t_ns), t_ns)
        tell(controller, reference(0.06, t_ns), t_ns)
        steps.append(controller.on_tick(t_ns))
    return steps


@pytest.mark.parametrize(("space", "count", "said"), OTHER_JOINTS)
@pytest.mark.parametrize("verb", [Verb.STATUS, Verb.ARM])
def test_joints_of_another_robot_are_refused_by_their_count_and_unit(
    verb: Verb, space: Space, count: int, said: str
) -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS))
    controller.start(0)
    tell(controller, other_joints(MS, space, count), MS)
    (reply,) = replies(tell(controller, order(verb, id=12), 2 * MS))
    assert (reply.id, reply.ok, reply.phase) == (12, False, Phase.IDLE)
    assert reply.text == f"{said}; {OTHER_ROBOT}"


def test_a_controller_that_hears_another_robot_alone_never_sends_anything() -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS))
    controller.start(T_START_NS - TICK_NS)
    for verb in (Verb.ARM, Verb.START):
        tell(controller, other_joints(T_START_NS), T_START_NS)
        (reply,) = replies(tell(controller, order(verb), T_START_NS))
        assert not reply.ok
    steps = run_with_other_joints(controller, range(100))
    assert [list(step.sends) for step in steps] == [[]] * 100


def test_joints_of_another_robot_are_neither_commanded_nor_reported() -> None:
    controller = after(Verb.ARM)
    steps = run_with_other_joints(controller, range(20))
    assert {s.position_m for step in steps for s in setpoints(step)} == {PARKED}
    messages = [send.message for step in steps for send in step.sends]
    states = [m for m in messages if isinstance(m, RobotState)]
    assert {(s.actual_m, s.t_actual_ns) for s in states} == {(PARKED, T_START_NS)}


@pytest.mark.parametrize("verbs", [(Verb.ARM,), (Verb.ARM, Verb.START)], ids=["armed", "running"])
def test_joints_of_another_robot_are_a_fault_after_100_ms_with_that_cause(
    verbs: tuple[Verb, ...],
) -> None:
    steps = run_with_other_joints(after(*verbs), range(40))
    ((k, report),) = [(k, r) for k, step in enumerate(steps) for r in replies(step)]
    assert k == 21
    assert (report.id, report.ok, report.exit, report.phase) == (0, False, 5, Phase.FAULT)
    assert report.text == (
        "no joint state for 105 ms; must be <= 100 ms (safety.robot_stale_ms): "
        f"joint states of 6 joints in rad; {OTHER_ROBOT}"
    )
    assert len(set(xs(steps[k:]))) == 1, "the setpoint stays where it is"


def test_once_the_right_robot_is_heard_its_silence_is_called_silence() -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS))
    controller.start(T_START_NS - TICK_NS)
    tell(controller, other_joints(T_START_NS), T_START_NS)
    tell(controller, joints(T_START_NS), T_START_NS)
    assert replies(tell(controller, order(Verb.ARM), T_START_NS))[0].ok
    (report,) = news(run(controller, range(40), encoders=False))
    assert report.text.endswith(": nothing arrived from the bench")
    (reply,) = replies(tell(controller, order(Verb.STATUS), T_START_NS + 40 * TICK_NS))
    assert reply.text.startswith("no joint state arrives from the encoders")


def at_speed() -> ControllerTask:
    """Controller after two windows along X, of 0.1 and of 0.2 m/s, and half of a third."""
    controller = after(Verb.ARM, Verb.START, envelope=DEFAULT_ENVELOPE)
    places = [0.053, 0.059, 0.065]
    run(controller, range(15), lambda k: places[k // 6])
    return controller


@pytest.mark.parametrize("first", [(), (Verb.STOP,)], ids=["moving", "running_out"])
def test_an_emergency_stop_freezes_the_setpoint_at_once_and_for_good(
    first: tuple[Verb, ...],
) -> None:
    controller = at_speed()
    for verb in first:
        tell(controller, order(verb), T_START_NS + 71 * MS)
    (before,) = xs(run(controller, range(15, 16), lambda k: 0.065))
    (reply,) = replies(tell(controller, order(Verb.ESTOP), T_START_NS + 76 * MS))
    assert (reply.ok, reply.phase) == (True, Phase.FAULT)
    tell(controller, order(Verb.STOP), T_START_NS + 77 * MS)
    steps = run(controller, range(16, 100), lambda k: 0.2)
    assert set(xs(steps)) == {before}
    assert news(steps) == []
    states = [m for m in (s.message for s in steps[-2].sends) if isinstance(m, RobotState)]
    assert {state.phase for state in states} == {Phase.FAULT}


def test_a_stop_in_mid_window_runs_out_inside_the_envelope_to_a_place_that_it_keeps() -> None:
    controller = at_speed()
    places = xs(run(at_speed(), range(14, 15), lambda k: 0.065))[-1:]
    (reply,) = replies(tell(controller, order(Verb.STOP), T_START_NS + 71 * MS))
    assert (reply.ok, reply.phase) == (True, Phase.STOPPED)
    steps = run(controller, range(15, 100), lambda k: 0.2)
    places += xs(steps)
    speeds = np.diff(places) / 5e-3
    history = np.concatenate([[0.1] * 3, [0.2] * 5, speeds])
    assert np.abs(history[6:] - history[:-6]).max() <= 5.5 * 0.03 + 1e-5
    assert np.diff(speeds).max() <= 1e-12
    assert speeds[0] > 0
    assert set(places[13:]) == {places[-1]}  # within two windows
    assert places[-1] < 0.07
    assert news(steps) == []


@pytest.mark.parametrize("verb", [Verb.STOP, Verb.ESTOP])
def test_a_stop_between_start_and_t_start_keeps_the_robot_where_it_is(verb: Verb) -> None:
    controller = after(Verb.ARM, Verb.START)
    tell(controller, order(verb), T_START_NS - MS)
    assert set(xs(run(controller, range(100), lambda k: 0.2))) == {0.05}


def test_an_emergency_stop_works_without_encoders() -> None:
    controller = ControllerTask(ControllerSettings(reference_stale_ns=STALE_NS))
    (reply,) = replies(tell(controller, order(Verb.ESTOP), 0))
    assert (reply.ok, reply.phase) == (True, Phase.FAULT)


def test_closing_sends_nothing_and_references_move_the_robot_no_more() -> None:
    controller = after(Verb.ARM, Verb.START)
    run(controller, range(3), lambda k: 0.056)
    assert controller.stop(T_START_NS + 11 * MS) == NO_STEP
    assert max(xs(run(controller, range(3, 30), lambda k: 0.2))) <= 0.056


@given(st.lists(st.one_of(st.none(), st.floats(-0.25, 0.25)), min_size=1, max_size=60))
def test_no_setpoint_steps_farther_than_a_sixth_of_what_the_references_span(
    places: list[float | None],
) -> None:
    got = xs(run(after(Verb.ARM, Verb.START), range(len(places)), lambda k: places[k]))
    known = [0.05, *(x for x in places if x is not None)]
    span = max(known) - min(known)
    for before, now in zip([0.05, *got], got, strict=False):
        assert abs(now - before) <= span / 6 + 1e-12


def test_settings_travel_as_json() -> None:
    settings = ControllerSettings(reference_stale_ns=STALE_NS)
    with pytest.raises(msgspec.ValidationError, match="reference_stale"):
        build(b"{}")
    built = build(msgspec.json.encode(settings))
    assert built.start(0) == ControllerTask(settings).start(0)


def test_a_controller_that_was_not_run_itself_says_so_and_not_that_the_bench_is_silent() -> None:
    controller = after(Verb.ARM, Verb.START)
    run(controller, range(4), lambda k: 0.06)
    (report,) = replies(controller.on_tick(T_START_NS + 130 * MS))
    assert report.exit == 5
    assert "this process itself was not run for" in report.text
    assert "run with --virtual" in report.text
    assert "bench" not in report.text
