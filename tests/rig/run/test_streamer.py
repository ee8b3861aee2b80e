"""The streamer: the plan at its ticks, the checks before the move, and stops that hold."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from comms.messages import (
    AngleSample,
    Command,
    InvalidReason,
    LinkAngle,
    Message,
    Phase,
    Position,
    Reference,
    Reply,
    RobotState,
    SwingPlane,
    Verb,
)
from comms.task import NO_STEP, Step
from rig.run.tasks.angle_watch import WatchedCamera
from rig.run.tasks.safety import Envelope
from rig.run.tasks.streamer import PERIOD_NS, Streamer, StreamerSettings, build

MS = 1_000_000
T_START_NS = 600 * MS
OMEGA_RAD_S = math.sqrt(9.81)
QUIET_TICKS, MOVE_TICKS = 100, 80


def smooth_plan(distance_m: float = 0.1) -> list[Position]:
    """1 s of rest, then a quintic in 0.8 s; its peak speed is 1.875 distance / time."""
    s = np.clip((np.arange(QUIET_TICKS + MOVE_TICKS + 1) - QUIET_TICKS) / MOVE_TICKS, 0.0, 1.0)
    return [(float(x), 0.0, 0.0) for x in distance_m * (10 * s**3 - 15 * s**4 + 6 * s**5)]


PLAN = smooth_plan()
SETTINGS = StreamerSettings(
    positions_m=PLAN,
    move_ticks=(QUIET_TICKS, QUIET_TICKS + MOVE_TICKS),
    envelope=Envelope(
        position_min_m=-0.25, position_max_m=0.25, speed_m_s=1.1, acceleration_m_s2=5.5
    ),
    natural_frequency_rad_s=OMEGA_RAD_S,
    initial_swing_rad=0.01,
)
WATCHED = msgspec.structs.replace(SETTINGS, cameras=[WatchedCamera(stale_ns=300 * MS)])
PATIENT = msgspec.structs.replace(SETTINGS, cameras=[WatchedCamera(stale_ns=60_000 * MS)])


def order(verb: Verb, t_ns: int = 0, t_start_ns: int = T_START_NS, id: int = 7) -> Command:
    """Order of the operator."""
    return Command(seq=0, t_ns=t_ns, id=id, to="streamer", verb=verb, t_start_ns=t_start_ns)


def robot_at(x_m: float, t_ns: int = 0) -> RobotState:
    """State of a robot at rest."""
    here, still = (x_m, 0.0, 0.0), (0.0, 0.0, 0.0)
    return RobotState(
        seq=0,
        t_ns=t_ns,
        t_actual_ns=t_ns,
        commanded_m=here,
        actual_m=here,
        actual_velocity_m_s=still,
        phase=Phase.ARMED,
    )


def angle(
    t_ns: int, angle_rad: float | None, reason: InvalidReason = InvalidReason.NONE
) -> AngleSample:
    """Angle sample of 35 ms ago."""
    links: tuple[LinkAngle, ...] = ()
    if angle_rad is not None:
        cable = LinkAngle(
            angle_rad=angle_rad, sigma_rad=1e-5, raw_rad=angle_rad, offset_rad=0.0, joint_px=None
        )
        links = (cable,)
    return AngleSample(
        seq=0,
        t_ns=t_ns,
        t_valid_ns=t_ns - 35 * MS,
        swing_plane=SwingPlane.X,
        valid=angle_rad is not None,
        reason=reason,
        platform_m=None,
        rows=400,
        residual_px=None,
        pivot_miss_px=None,
        background=200.0,
        saturation=0.0,
        links=links,
    )


def tell(streamer: Streamer, message: Message, t_ns: int) -> Step:
    """Pass a message to the task."""
    channel = "angle_1" if isinstance(message, AngleSample) else "-"
    return streamer.on_message(channel, message, t_ns)


def replies(step: Step) -> list[Reply]:
    """Answers and reports of a step."""
    return [send.message for send in step.sends if isinstance(send.message, Reply)]


def references(step: Step) -> list[Reference]:
    """References of a step."""
    return [send.message for send in step.sends if isinstance(send.message, Reference)]


def started(settings: StreamerSettings = SETTINGS) -> Streamer:
    """Streamer that was armed and started at 100 ms, with the robot in place."""
    return arm_and_start(Streamer(settings))


def arm_and_start(streamer: Streamer) -> Streamer:
    """Arm and start."""
    streamer.start(0)
    tell(streamer, robot_at(0.0), 90 * MS)
    for verb in (Verb.ARM, Verb.START):
        (reply,) = replies(tell(streamer, order(verb), 100 * MS))
        assert reply.ok, reply.text
    return streamer


def tick(streamer: Streamer, t_ns: int) -> Step:
    """Tick of a streamer that has a fresh robot state."""
    tell(streamer, robot_at(0.0, t_ns), t_ns)
    return streamer.on_tick(t_ns)


def play(streamer: Streamer, ticks: range, late_ns: int = 0) -> list[Step]:
    """Ticks from t_start on, each woken late."""
    return [tick(streamer, T_START_NS + k * PERIOD_NS + late_ns) for k in ticks]


def see(streamer: Streamer, ticks: range, amplitude_rad: float) -> list[Step]:
    """Ticks with an angle of the swinging load at every second one."""
    steps = []
    for k in ticks:
        t_ns = T_START_NS + k * PERIOD_NS
        if k % 2 == 0:
            sample = angle(t_ns, amplitude_rad * math.sin(OMEGA_RAD_S * (t_ns - 35 * MS) * 1e-9))
            tell(streamer, sample, t_ns)
        steps.append(tick(streamer, t_ns))
    return steps


def test_every_tick_sends_the_plan_at_that_tick_with_its_target_time() -> None:
    sent = [
        reference for step in play(started(), range(len(PLAN))) for reference in references(step)
    ]
    assert [r.position_m for r in sent] == PLAN
    assert [r.t_target_ns for r in sent] == [T_START_NS + k * PERIOD_NS for k in range(len(PLAN))]
    assert [r.seq for r in sent] == list(range(len(PLAN)))


def test_a_streamer_that_wakes_late_still_sends_the_scheduled_position_and_keeps_its_grid() -> None:
    late_ns = 4 * MS
    for k, step in enumerate(play(started(), range(len(PLAN)), late_ns)):
        (reference,) = references(step)
        assert reference.position_m == PLAN[k]
        assert (reference.t_target_ns, reference.t_ns) == (
            T_START_NS + k * PERIOD_NS,
            T_START_NS + k * PERIOD_NS + late_ns,
        )
        assert step.wake_ns == T_START_NS + (k + 1) * PERIOD_NS


def test_missed_ticks_are_counted_and_never_made_up() -> None:
    streamer = started()
    play(streamer, range(10))
    (step,) = play(streamer, range(13, 14))
    assert [r.position_m for r in references(step)] == [PLAN[13]]
    assert streamer.late_ticks == 3
    assert step.wake_ns == T_START_NS + 14 * PERIOD_NS
    play(streamer, range(14, 20))
    assert streamer.late_ticks == 3


def test_a_wake_before_its_time_sends_nothing_and_asks_again() -> None:
    streamer = started()
    assert streamer.on_tick(T_START_NS - 1) == Step(wake_ns=T_START_NS)
    play(streamer, range(5))
    assert streamer.on_tick(T_START_NS + 4 * PERIOD_NS + 1) == Step(
        wake_ns=T_START_NS + 5 * PERIOD_NS
    )
    assert streamer.late_ticks == 0


def test_after_the_plan_the_last_position_is_repeated() -> None:
    streamer = started()
    play(streamer, range(len(PLAN)))
    for step in play(streamer, range(len(PLAN), len(PLAN) + 200)):
        assert [r.position_m for r in references(step)] == [PLAN[-1]]


def test_start_asks_to_be_woken_at_t_start_and_nothing_leaves_before() -> None:
    streamer = Streamer(SETTINGS)
    assert streamer.start(0) == NO_STEP
    tell(streamer, robot_at(0.0), 0)
    assert tell(streamer, order(Verb.ARM), 0).wake_ns is None
    assert streamer.on_tick(5 * MS) == NO_STEP
    step = tell(streamer, order(Verb.START), 10 * MS)
    assert step.wake_ns == T_START_NS
    assert references(step) == []


def start_with(
    state: RobotState | None, t_state_ns: int = 0, t_ns: int = 0, plan: list[Position] = PLAN
) -> Reply:
    """Answer to START after this robot state."""
    streamer = Streamer(msgspec.structs.replace(SETTINGS, positions_m=plan))
    if state is not None:
        tell(streamer, state, t_state_ns)
    tell(streamer, order(Verb.ARM), t_ns)
    step = tell(streamer, order(Verb.START), t_ns)
    (reply,) = replies(step)
    assert (step.wake_ns is None) == (not reply.ok), "a refused start asks for no wake"
    if not reply.ok:
        assert streamer.on_tick(T_START_NS) == NO_STEP
    return reply


@pytest.mark.parametrize("x_m", [0.0, 0.0019, -0.0019])
def test_start_is_taken_with_the_robot_within_two_millimetres(x_m: float) -> None:
    assert start_with(robot_at(x_m)).ok


@pytest.mark.parametrize("x_m", [0.0021, -0.0021, 0.1])
def test_start_is_refused_with_the_robot_elsewhere_and_names_both_places_and_the_bound(
    x_m: float,
) -> None:
    reply = start_with(robot_at(x_m))
    assert (reply.ok, reply.exit, reply.phase) == (False, 3, Phase.ARMED)
    assert reply.text == (
        f"start refused: the robot stands at ({x_m:.4f}, 0.0000, 0.0000) m, "
        f"the move starts at (0.0000, 0.0000, 0.0000) m, {abs(x_m) * 1e3:.1f} mm away; "
        "must be <= 2 mm: bring the robot there, or set move.start_m to where it stands"
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_distance_counts_along_every_axis(axis: int) -> None:
    plan: list[Position] = [(0.003 * (axis == 0), 0.003 * (axis == 1), 0.003 * (axis == 2))]
    assert "3.0 mm away" in start_with(robot_at(0.0), plan=plan).text


def test_it_is_the_actual_place_that_counts_not_the_commanded_one() -> None:
    state = msgspec.structs.replace(robot_at(0.0), actual_m=(0.05, 0.0, 0.0))
    assert "(0.0500, 0.0000, 0.0000) m" in start_with(state).text


def test_it_is_the_newest_state_that_counts() -> None:
    streamer = Streamer(SETTINGS)
    tell(streamer, robot_at(0.0), 0)
    tell(streamer, robot_at(0.1), 10 * MS)
    tell(streamer, order(Verb.ARM), 10 * MS)
    assert not replies(tell(streamer, order(Verb.START), 10 * MS))[0].ok


def test_start_is_refused_without_a_robot_state() -> None:
    reply = start_with(None)
    assert (reply.ok, reply.exit) == (False, 3)
    assert reply.text == (
        "start refused: the robot state has not arrived; must be <= 100 ms old: "
        "are controller and bench running?"
    )


@pytest.mark.parametrize(("age_ms", "ok"), [(100, True), (101, False)])
def test_a_robot_state_may_be_100_ms_old_and_no_older(age_ms: int, ok: bool) -> None:
    reply = start_with(robot_at(0.0), 50 * MS, (50 + age_ms) * MS)
    assert reply.ok is ok
    assert ok or f"is {age_ms} ms old" in reply.text


def test_a_start_in_the_past_is_refused_for_the_plan_would_begin_in_its_middle() -> None:
    late_ns = T_START_NS + 250 * MS
    reply = start_with(robot_at(0.0), late_ns, late_ns)
    assert not reply.ok
    assert "t_start is 250 ms past; must lie ahead" in reply.text


def test_a_start_at_this_very_instant_is_taken() -> None:
    assert start_with(robot_at(0.0), T_START_NS, T_START_NS).ok


def test_a_plan_that_starts_outside_the_envelope_is_refused_at_start() -> None:
    reply = start_with(robot_at(0.3), plan=[(0.3, 0.0, 0.0)])
    assert reply.text == "start refused: safety gate: x = 0.3000 m; must be -0.25 to 0.25 m"


def test_a_streamer_that_sleeps_through_the_quiet_time_does_not_jump_into_the_plan() -> None:
    (step,) = play(started(), range(len(PLAN), len(PLAN) + 1))
    assert references(step) == []
    assert [(r.ok, r.exit, r.phase) for r in replies(step)] == [(False, 5, Phase.STOPPED)]


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
def test_an_order_that_does_not_fit_the_phase_is_refused_with_its_id(
    history: list[Verb], verb: Verb
) -> None:
    streamer = Streamer(SETTINGS)
    tell(streamer, robot_at(0.0), 0)
    for earlier in history:
        tell(streamer, order(earlier), 0)
    (reply,) = replies(tell(streamer, order(verb, id=31), 0))
    assert (reply.id, reply.ok) == (31, False)
    assert f"{verb.value} refused: {reply.phase.value}; must be" in reply.text


def test_an_arm_order_while_running_does_not_interrupt_the_plan() -> None:
    streamer = started()
    play(streamer, range(5))
    tell(streamer, order(Verb.ARM), T_START_NS + 45 * MS)
    assert references(play(streamer, range(5, 6))[0])[0].position_m == PLAN[5]


def test_an_emergency_stop_in_mid_move_holds_the_last_position_for_good() -> None:
    streamer, middle = started(), QUIET_TICKS + 40
    play(streamer, range(middle + 1))
    (reply,) = replies(tell(streamer, order(Verb.ESTOP), T_START_NS + middle * PERIOD_NS + 1))
    assert (reply.ok, reply.phase) == (True, Phase.FAULT)
    for step in play(streamer, range(middle + 1, middle + 300)):
        assert [r.position_m for r in references(step)] == [PLAN[middle]]
        assert replies(step) == []


def runs_out(steps: list[Step], before: list[Position]) -> None:
    """Check references after a stop: they decelerate inside the envelope and then stay."""
    after = [r.position_m for step in steps for r in references(step)]
    x = np.array([*before[-2:], *after])[:, 0]
    acceleration_m_s2 = np.diff(x, 2) / 1e-4
    assert np.abs(acceleration_m_s2).max() <= 5.5 + 1e-3
    assert acceleration_m_s2.max() <= 1e-9  # never faster again
    assert len(after) == len(steps)
    assert len(set(after[5:])) == 1  # 0.23 m/s take 43 ms


def test_a_stop_in_mid_move_runs_out_and_holds_its_place_for_good() -> None:
    streamer, middle = started(), QUIET_TICKS + 40
    play(streamer, range(middle + 1))
    (reply,) = replies(tell(streamer, order(Verb.STOP), T_START_NS + middle * PERIOD_NS + 1))
    assert (reply.ok, reply.phase) == (True, Phase.STOPPED)
    steps = play(streamer, range(middle + 1, middle + 300))
    runs_out(steps, PLAN[: middle + 1])
    assert [r for step in steps for r in replies(step)] == []


def test_held_references_still_carry_new_counts_and_target_times() -> None:
    streamer = started()
    play(streamer, range(3))
    tell(streamer, order(Verb.STOP), T_START_NS + 25 * MS)
    sent = [references(step)[0] for step in play(streamer, range(3, 6))]
    assert [(r.seq, r.t_target_ns) for r in sent] == [
        (k, T_START_NS + k * PERIOD_NS) for k in (3, 4, 5)
    ]


@pytest.mark.parametrize("verb", [Verb.STOP, Verb.ESTOP])
def test_a_stop_before_t_start_keeps_every_reference_back(verb: Verb) -> None:
    streamer = started()
    tell(streamer, order(verb), T_START_NS - MS)
    assert all(references(step) == [] for step in play(streamer, range(len(PLAN))))


def test_closing_ends_the_references() -> None:
    streamer = started()
    play(streamer, range(5))
    assert streamer.stop(T_START_NS + 45 * MS) == NO_STEP
    assert play(streamer, range(5, 10)) == [NO_STEP] * 5


def test_status_is_answered_in_any_phase_and_replies_are_counted() -> None:
    streamer = Streamer(SETTINGS)
    streamer.on_message("robot_state", robot_at(0.0), 0)
    got = [replies(tell(streamer, order(Verb.STATUS, id=k), 0))[0] for k in (1, 2, 3)]
    assert [(r.id, r.ok, r.seq, r.sender) for r in got] == [
        (k, True, k - 1, "streamer") for k in (1, 2, 3)
    ]


def test_the_streamer_is_not_ready_before_it_knows_where_the_robot_stands() -> None:
    streamer = Streamer(SETTINGS)
    (early,) = replies(tell(streamer, order(Verb.STATUS), 0))
    streamer.on_message("robot_state", robot_at(0.0), 5 * MS)
    (later,) = replies(tell(streamer, order(Verb.STATUS), 6 * MS))
    assert (early.ok, later.ok) == (False, True)
    assert "no robot state has arrived" in early.text


def test_a_plan_that_jumps_is_stopped_before_the_jump_and_runs_out() -> None:
    jump = QUIET_TICKS + 40
    plan = [*PLAN[:jump], (0.2, 0.0, 0.0), (0.2, 0.0, 0.0)]
    streamer = started(msgspec.structs.replace(SETTINGS, positions_m=plan))
    steps = play(streamer, range(jump + 45))
    sent = [r.position_m for step in steps for r in references(step)]
    assert sent[:jump] == PLAN[:jump]
    runs_out(steps[jump:], PLAN[:jump])
    (news,) = [r for step in steps for r in replies(step)]
    assert (news.id, news.ok, news.exit, news.phase) == (0, False, 5, Phase.STOPPED)
    assert news.text.startswith("safety gate: speed")


@pytest.mark.parametrize("bad", [math.nan, math.inf, 0.26])
def test_a_place_outside_the_envelope_or_no_number_never_leaves(bad: float) -> None:
    plan = [(0.0, 0.0, 0.0)] * 3 + [(0.0, bad, 0.0)]
    streamer = started(msgspec.structs.replace(SETTINGS, positions_m=plan))
    sent = [r.position_m for step in play(streamer, range(8)) for r in references(step)]
    assert sent == [(0.0, 0.0, 0.0)] * 8


def test_a_load_at_rest_is_reported_with_its_amplitude_and_the_move_goes_on() -> None:
    streamer = started(WATCHED)
    steps = see(streamer, range(QUIET_TICKS + 2), 0.004)
    (news,) = [r for step in steps for r in replies(step)]
    assert (news.ok, news.exit, news.id) == (True, None, 0)
    assert news.text == "the load swings 4.00 mrad before the start"
    assert replies(steps[QUIET_TICKS]) == [news], "reported at the first tick of the move"
    assert references(steps[-1])[0].position_m == PLAN[QUIET_TICKS + 1]


def test_a_swinging_load_is_refused_with_amplitude_bound_and_a_hint_that_suffices() -> None:
    streamer = started(WATCHED)
    steps = see(streamer, range(QUIET_TICKS + 20), 0.05)
    (news,) = [r for step in steps for r in replies(step)]
    assert (news.ok, news.exit, news.phase) == (False, 3, Phase.STOPPED)
    assert news.text == (
        "the load swings 50.00 mrad before the start; must be <= 10.00 mrad: "
        "wait, or allow it with --set safety.initial_swing_rad=0.06"
    )
    assert {r.position_m for step in steps for r in references(step)} == {PLAN[0]}
    allowed = see(
        started(msgspec.structs.replace(WATCHED, initial_swing_rad=0.06)),
        range(QUIET_TICKS + 1),
        0.05,
    )
    assert all(r.ok for step in allowed for r in replies(step))


def test_a_swing_inside_the_move_alone_does_not_refuse_it() -> None:
    """The move itself makes the load swing: its samples are no quiet ones."""
    streamer = started(WATCHED)
    quiet = see(streamer, range(QUIET_TICKS + 1), 0.004)  # up to the first tick of the move
    moving = see(streamer, range(QUIET_TICKS + 1, QUIET_TICKS + MOVE_TICKS), 0.3)
    (news,) = [r for step in (*quiet, *moving) for r in replies(step)]
    assert (news.ok, news.exit) == (True, None)
    assert news.text == "the load swings 4.00 mrad before the start"
    assert references(moving[-1])[0].position_m == PLAN[QUIET_TICKS + MOVE_TICKS - 1]


@pytest.mark.parametrize("before", [10, 30, 50])
def test_a_swing_that_begins_shortly_before_the_move_refuses_it(before: int) -> None:
    """The samples up to the first tick of the move count."""
    streamer = started(WATCHED)
    see(streamer, range(QUIET_TICKS - before), 0.004)
    steps = see(streamer, range(QUIET_TICKS - before, QUIET_TICKS + 20), 0.3)
    (news,) = [r for step in steps for r in replies(step)]
    assert (news.ok, news.exit, news.phase) == (False, 3, Phase.STOPPED)
    assert {r.position_m for step in steps for r in references(step)} == {PLAN[0]}


def test_a_late_tick_over_the_start_of_the_move_does_not_skip_the_check() -> None:
    streamer = started(WATCHED)
    see(streamer, range(QUIET_TICKS - 2), 0.05)
    (step,) = see(streamer, range(QUIET_TICKS + 2, QUIET_TICKS + 3), 0.05)
    assert [r.exit for r in replies(step)] == [3]
    assert references(step)[0].position_m == PLAN[0]


@pytest.mark.parametrize(
    ("first", "last"),
    [
        pytest.param(QUIET_TICKS, QUIET_TICKS, id="no_picture"),
        pytest.param(QUIET_TICKS - 2, QUIET_TICKS, id="one_picture"),
        pytest.param(QUIET_TICKS - 30, QUIET_TICKS, id="less_than_a_quarter_period"),
    ],
)
def test_a_move_is_refused_when_the_quiet_interval_is_too_short_for_the_initial_swing(
    first: int, last: int
) -> None:
    streamer = started(PATIENT)
    play(streamer, range(first))
    steps = see(streamer, range(first, last), 0.05) + play(streamer, range(last, last + 1))
    (news,) = [r for step in steps for r in replies(step)]
    assert (news.ok, news.exit) == (False, 3)
    assert "the swing before the start cannot be measured" in news.text
    assert "raise quiet_s" in news.text


def test_a_move_without_quiet_time_starts_without_the_check_and_reports_it() -> None:
    streamer = started(msgspec.structs.replace(PATIENT, move_ticks=(0, PATIENT.move_ticks[1])))
    (news,) = [r for step in play(streamer, range(1)) for r in replies(step)]
    assert (news.ok, news.exit) == (True, None)
    assert "the swing before the start cannot be measured" in news.text


def test_no_swing_is_reported_without_a_move() -> None:
    still = msgspec.structs.replace(WATCHED, positions_m=[(0.0, 0.0, 0.0)], move_ticks=(0, 0))
    assert [r for step in see(started(still), range(50), 0.06) for r in replies(step)] == []


def test_no_swing_is_reported_without_a_camera() -> None:
    assert [r for step in play(started(), range(len(PLAN))) for r in replies(step)] == []


def test_a_stopped_streamer_does_not_check_the_swing() -> None:
    streamer = started(WATCHED)
    see(streamer, range(QUIET_TICKS - 10), 0.05)
    tell(streamer, order(Verb.STOP), T_START_NS + (QUIET_TICKS - 10) * PERIOD_NS)
    assert [
        r
        for step in see(streamer, range(QUIET_TICKS - 9, QUIET_TICKS + 9), 0.05)
        for r in replies(step)
    ] == []


def test_a_stale_angle_stops_the_move_with_exit_5_at_the_first_tick_beyond_the_bound() -> None:
    streamer, seen = started(WATCHED), QUIET_TICKS + 20
    see(streamer, range(seen + 1), 0.0)
    steps = play(streamer, range(seen + 1, seen + 60))
    reported = [(k, r) for k, step in enumerate(steps, seen + 1) for r in replies(step)]
    ((k, news),) = reported
    assert k == seen + 31  # 310 ms after the last picture; 300 ms are still good
    assert (news.ok, news.exit, news.phase) == (False, 5, Phase.STOPPED)
    assert news.text.startswith(
        "no valid cable angle for 310 ms; must be <= 300 ms (no picture arrived): check camera"
    )
    runs_out(steps[k - seen - 1 :], PLAN[: seen + 31])


def test_pictures_without_a_cable_do_not_count_and_their_reason_is_reported() -> None:
    streamer = started(WATCHED)
    news = []
    for k in range(40):
        tell(
            streamer,
            angle(T_START_NS + k * PERIOD_NS, None, InvalidReason.NO_CABLE),
            T_START_NS + k * PERIOD_NS,
        )
        news += replies(play(streamer, range(k, k + 1))[0])
    assert [r.exit for r in news] == [5]
    assert "last reason: no_cable" in news[0].text


def test_an_angle_marked_invalid_does_not_count_even_with_a_value() -> None:
    streamer, news = started(WATCHED), []
    for k in range(40):
        sample = msgspec.structs.replace(
            angle(T_START_NS + k * PERIOD_NS, 0.0), valid=False, reason=InvalidReason.POOR_FIT
        )
        tell(streamer, sample, T_START_NS + k * PERIOD_NS)
        news += replies(play(streamer, range(k, k + 1))[0])
    assert [r.exit for r in news] == [5]
    assert "last reason: poor_fit" in news[0].text


def test_a_gap_shorter_than_the_bound_is_tolerated() -> None:
    streamer = started(WATCHED)
    see(streamer, range(11), 0.0)
    play(streamer, range(11, 40))
    steps = see(streamer, range(40, QUIET_TICKS - 1), 0.0)
    assert [r for step in steps for r in replies(step)] == []


def test_missing_angles_are_detected_from_t_start_on() -> None:
    streamer = started(WATCHED)
    assert [r for step in play(streamer, range(31)) for r in replies(step)] == []
    (news,) = replies(play(streamer, range(31, 32))[0])
    assert (news.exit, news.phase) == (5, Phase.STOPPED)
    assert "no valid cable angle for 310 ms" in news.text
    assert "no picture arrived" in news.text


def test_a_silent_controller_stops_the_move_at_the_first_tick_beyond_the_bound() -> None:
    streamer, middle = started(), QUIET_TICKS + 40
    play(streamer, range(middle + 1))
    ticks = range(middle + 1, middle + 60)
    steps = [streamer.on_tick(T_START_NS + k * PERIOD_NS) for k in ticks]
    ((k, news),) = [(k, r) for k, step in zip(ticks, steps, strict=True) for r in replies(step)]
    assert k == middle + 11  # 110 ms after the last robot state; 100 ms are still good
    assert (news.ok, news.exit, news.phase) == (False, 5, Phase.STOPPED)
    assert news.text == (
        "no robot state for 110 ms; must be <= 100 ms (safety.robot_stale_ms): "
        "nothing arrived from the controller"
    )


def test_a_robot_state_is_missed_from_t_start_on() -> None:
    streamer = started()  # its only robot state arrived 510 ms before
    steps = [streamer.on_tick(T_START_NS + k * PERIOD_NS) for k in range(12)]
    assert [len(replies(step)) for step in steps] == [0] * 11 + [1]


def test_settings_travel_as_json_and_a_position_counts_as_three_numbers() -> None:
    assert play(arm_and_start(build(msgspec.json.encode(SETTINGS))), range(3)) == play(
        started(), range(3)
    )
    with pytest.raises(msgspec.ValidationError, match="positions_m"):
        build(msgspec.json.encode(SETTINGS).replace(b"[0.0,0.0,0.0]", b"[0.0,0.0]", 1))
