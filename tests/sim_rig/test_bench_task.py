"""Bench task: time stamps on their grids, setpoints at the drives' next sample, late wakes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from comms.messages import (
    Command,
    Frame,
    JointState,
    LinkMotion,
    Message,
    Phase,
    Reply,
    Setpoint,
    Space,
    Truth,
    Verb,
    axis_setpoint,
)
from comms.task import Send, Step, Task
from sim_rig.bench import Bench
from sim_rig.camera_params import CameraParams
from sim_rig.params import BenchParams, PendulumParams, View
from sim_rig.task import MAX_CATCH_UP_NS, BenchTask

MS = 1_000_000
SMALL = View(width=64, height=48)
SWINGING = BenchParams(pendulum=PendulumParams(initial_swing_rad=0.2), view=SMALL)
BLIND = BenchParams(pendulum=PendulumParams(initial_swing_rad=0.2), view=View(rate_hz=0.0))


def setpoint(seq: int, t_ns: int, x_m: float) -> Setpoint:
    return axis_setpoint(seq, t_ns, (x_m, 0.0, 0.0))


def run(
    task: Task, wakes_ns: Iterable[int], setpoints: Iterable[tuple[int, float]] = ()
) -> list[Send]:
    """Start at 0, then serve ticks and setpoints in the order of time."""
    sends = list(task.start(0).sends)
    calls: list[tuple[int, float | None]] = [*((t, None) for t in wakes_ns), *setpoints]
    for n, (t_ns, x_m) in enumerate(sorted(calls, key=lambda call: call[0])):
        step = (
            task.on_tick(t_ns)
            if x_m is None
            else task.on_message("setpoint", setpoint(n, t_ns, x_m), t_ns)
        )
        sends += step.sends
    return sends


def messages(sends: list[Send], channel: str) -> list[Message]:
    return [send.message for send in sends if send.channel == channel]


def stamps(sends: list[Send], channel: str) -> list[int]:
    return [message.t_ns for message in messages(sends, channel)]


def only_link(truth: Truth) -> LinkMotion:
    """The cable of a load without further links."""
    (link,) = truth.links
    return link


def facts(sends: list[Send], channel: str) -> list[object]:
    """Comparable content of the messages: pixels as bytes."""
    return [
        (m.seq, m.t_ns, m.pixels.tobytes()) if isinstance(m, Frame) else m
        for m in messages(sends, channel)
    ]


def test_every_channel_keeps_its_own_grid() -> None:
    sends = run(BenchTask(SWINGING), range(5 * MS, 101 * MS, 5 * MS))
    assert stamps(sends, "joint_state") == [k * 5 * MS for k in range(21)]
    assert stamps(sends, "truth") == [k * 10 * MS for k in range(11)]
    assert stamps(sends, "frame_1") == [k * 20 * MS + 10 * MS for k in range(5)]
    for channel in ("joint_state", "truth", "frame_1"):
        numbers = [m.seq for m in messages(sends, channel)]
        assert numbers == list(range(len(numbers)))


def test_a_punctual_wake_serves_everything_at_its_time() -> None:
    task = BenchTask(BenchParams(view=SMALL, cameras=(CameraParams(exposure_ms=3.0),)))
    step, late = task.start(0), []
    for _ in range(100):
        assert step.wake_ns is not None
        t_ns = step.wake_ns
        step = task.on_tick(t_ns)
        late += [t_ns - send.message.t_ns for send in step.sends]
        assert all(send.at_ns == t_ns for send in step.sends)
    assert late
    assert set(late) == {0}
    assert task.late_ticks == 0


def test_a_frame_holds_its_exposure_and_format() -> None:
    frame = messages(run(BenchTask(SWINGING), [35 * MS]), "frame_1")[0]
    assert isinstance(frame, Frame)
    assert (frame.t_exposure_start_ns, frame.exposure_ns, frame.row_ns) == (0, 10 * MS, 0)
    assert (frame.camera, frame.encoding, frame.height, frame.width) == (
        "red_plane",
        "mono8",
        48,
        64,
    )
    assert frame.pixels.shape == (48, 64)
    assert frame.pixels.dtype == np.uint8


def test_readings_and_truth_are_those_of_the_bench_at_their_time_stamps() -> None:
    sends = run(BenchTask(BLIND), [5 * MS, 10 * MS, 20 * MS, 30 * MS], [(7 * MS + 1, 0.001)])
    plant = Bench(BLIND)
    plant.advance(8 * MS)  # next sample of the drives
    plant.set_setpoint((0.001, 0.0, 0.0))
    for truth in messages(sends, "truth")[1:]:
        assert isinstance(truth, Truth)
        plant.advance(truth.t_ns)
        load = only_link(truth)
        assert load.angle_x_rad == pytest.approx(plant.angle_rad, abs=1e-13)
        assert load.rate_x_rad_s == pytest.approx(plant.angular_velocity_rad_s, abs=1e-13)
        assert (load.angle_y_rad, load.rate_y_rad_s) == (0.0, 0.0)
        assert truth.position_m == pytest.approx(plant.position_m, abs=1e-15)
        assert truth.velocity_m_s == pytest.approx(plant.velocity_m_s, abs=1e-13)
    reading = messages(sends, "joint_state")[-1]
    assert isinstance(reading, JointState)
    assert reading.t_ns == 30 * MS
    assert reading.position_m == pytest.approx(plant.position_m, abs=1e-15)
    assert reading.velocity_m_s == pytest.approx(plant.velocity_m_s, abs=1e-13)
    assert (reading.space, reading.count) == (Space.METRES, 3)
    assert reading.values[0] > 0.0005


@given(wakes_ns=st.lists(st.integers(1, 199 * MS), max_size=12))
@settings(max_examples=15, deadline=None)
def test_truth_and_frames_do_not_depend_on_the_wake_up_times(wakes_ns: list[int]) -> None:
    arrivals = [(8 * MS + 123_457, 0.0004), (51 * MS, 0.001), (98 * MS + 1, 0.002)]
    punctual, delayed = BenchTask(SWINGING), BenchTask(SWINGING)
    expected = run(punctual, range(5 * MS, 201 * MS, 5 * MS), arrivals)
    got = run(delayed, [*wakes_ns, 200 * MS], arrivals)
    for channel in ("truth", "frame_1"):
        assert facts(got, channel) == facts(expected, channel)
    assert punctual.late_ticks == 0
    assert delayed.late_ticks == len(messages(expected, "joint_state")) - len(
        messages(got, "joint_state")
    )


def test_setpoints_that_arrive_in_the_same_sample_of_the_drives_have_the_same_effect() -> None:
    early = run(
        BenchTask(BLIND), range(5 * MS, 101 * MS, 5 * MS), [(20 * MS, 0.001), (55 * MS, 0.002)]
    )
    later = run(
        BenchTask(BLIND),
        range(5 * MS, 101 * MS, 5 * MS),
        [(20 * MS + 999_999, 0.001), (55 * MS + 1, 0.002)],
    )
    assert facts(early, "truth") == facts(later, "truth")


def test_a_late_wake_sends_only_the_newest_reading_and_counts_the_rest() -> None:
    task = BenchTask(SWINGING)
    task.start(0)
    sends = list(task.on_tick(33 * MS).sends)
    assert stamps(sends, "joint_state") == [30 * MS]
    assert stamps(sends, "truth") == [10 * MS, 20 * MS, 30 * MS]
    assert task.late_ticks == 5
    assert [send.at_ns for send in sends] == [33 * MS] * len(sends)


def test_a_long_delay_is_simulated_in_parts_and_loses_nothing() -> None:
    task = BenchTask(SWINGING)
    sends, step = list(task.start(0).sends), Step()
    t_ns, calls = 10 * MAX_CATCH_UP_NS, 0
    while step.wake_ns is None or step.wake_ns <= t_ns:
        step = task.on_tick(t_ns)
        assert len(messages(list(step.sends), "frame_1")) <= MAX_CATCH_UP_NS // (20 * MS) + 1
        assert step.wake_ns is not None
        assert step.wake_ns >= t_ns
        sends += step.sends
        calls += 1
    assert calls >= 10
    assert stamps(sends, "truth") == list(range(0, t_ns + 1, 10 * MS))
    assert stamps(sends, "frame_1") == list(range(10 * MS, t_ns + 1, 20 * MS))


def test_setpoints_that_arrive_during_a_long_delay_act_at_their_own_time() -> None:
    arrivals = [(2 * MAX_CATCH_UP_NS + 3 * MS + 7, 0.001), (2 * MAX_CATCH_UP_NS + 4 * MS, 0.0005)]
    end_ns = 3 * MAX_CATCH_UP_NS
    expected = run(BenchTask(BLIND), range(5 * MS, end_ns + 1, 5 * MS), arrivals)
    got = run(BenchTask(BLIND), [end_ns] * 5, arrivals)
    assert facts(got, "truth") == facts(expected, "truth")


def test_a_setpoint_stamped_before_the_present_acts_at_once() -> None:
    task = BenchTask(BLIND)
    task.start(0)
    task.on_tick(20 * MS)
    task.on_message("setpoint", setpoint(0, 0, 0.001), 19 * MS)
    truth = messages(list(task.on_tick(30 * MS).sends), "truth")[0]
    plant = Bench(BLIND)
    plant.advance(20 * MS)
    plant.set_setpoint((0.001, 0.0, 0.0))
    plant.advance(30 * MS)
    assert isinstance(truth, Truth)
    assert truth.position_m == pytest.approx(plant.position_m, abs=1e-15)


def test_a_load_is_released_at_the_start_and_stamps_stay_on_the_run_clock() -> None:
    task = BenchTask(SWINGING)
    first = task.start(1003 * MS)
    assert first.sends == []
    assert first.wake_ns == 1005 * MS
    truth = messages(list(task.on_tick(1010 * MS).sends), "truth")[0]
    plant = Bench(SWINGING)
    plant.advance(7 * MS)
    assert isinstance(truth, Truth)
    assert truth.t_ns == 1010 * MS
    assert only_link(truth).angle_x_rad == pytest.approx(plant.angle_rad, abs=1e-12)
    assert stamps(list(task.on_tick(1050 * MS).sends), "frame_1") == [1030 * MS, 1050 * MS]


def test_the_picture_shows_the_platform_and_the_angle_of_mid_exposure() -> None:
    params = BenchParams(
        pendulum=PendulumParams(initial_swing_rad=0.1),
        cameras=(CameraParams(noise=0.0, pitch_deg=0.0),),
    )
    sends = run(BenchTask(params), range(5 * MS, 300 * MS, 5 * MS), [(50 * MS, 0.1)])
    for frame in messages(sends, "frame_1")[1:]:
        assert isinstance(frame, Frame)
        dark = 200.0 - frame.pixels.astype(float)
        centroid = (dark * np.arange(640)).sum(axis=1) / dark.sum(axis=1)
        plant = Bench(params)
        if frame.t_exposure_start_ns >= 50 * MS:
            plant.advance(51 * MS)
            plant.set_setpoint((0.001, 0.0, 0.0))
        plant.advance(frame.t_exposure_start_ns + 5 * MS)
        slope, pivot = np.polyfit(np.arange(480) + 40.0, centroid, 1)
        assert np.arctan(slope) == pytest.approx(plant.angle_rad, abs=0.5e-3)
        assert pivot == pytest.approx(320.0 + 1000.0 * plant.position_m[0], abs=0.6)


def test_without_a_camera_there_are_no_frames() -> None:
    sends = run(BenchTask(BLIND), range(5 * MS, 101 * MS, 5 * MS))
    assert {send.channel for send in sends} == {"joint_state", "truth"}


@pytest.mark.parametrize("verb", list(Verb))
def test_every_command_is_answered_with_its_id_and_changes_nothing(verb: Verb) -> None:
    task = BenchTask(BLIND)
    task.start(0)
    step = task.on_message("command", Command(seq=0, t_ns=1, id=42, to="bench", verb=verb), 12)
    assert (step.wake_ns, step.exit) == (None, None)
    (send,) = step.sends
    reply = send.message
    assert isinstance(reply, Reply)
    assert (send.channel, send.at_ns, reply.seq, reply.id, reply.sender, reply.ok) == (
        "reply",
        12,
        0,
        42,
        "bench",
        True,
    )


def test_the_bench_is_idle_until_a_setpoint_comes() -> None:
    task = BenchTask(BLIND)
    task.start(0)
    phases = []
    for seq in range(2):
        reply = (
            task.on_message(
                "command", Command(seq=seq, t_ns=0, id=seq, to="bench", verb=Verb.STATUS), 0
            )
            .sends[0]
            .message
        )
        assert isinstance(reply, Reply)
        phases.append(reply.phase)
        task.on_message("setpoint", setpoint(0, 0, 0.0), 0)
    assert phases == [Phase.IDLE, Phase.RUNNING]


def test_a_repeated_setpoint_changes_nothing() -> None:
    once = run(BenchTask(BLIND), range(5 * MS, 101 * MS, 5 * MS), [(11 * MS, 0.001)])
    again = run(
        BenchTask(BLIND),
        range(5 * MS, 101 * MS, 5 * MS),
        [(11 * MS, 0.001), (42 * MS + 1, 0.001), (77 * MS, 0.001)],
    )
    assert facts(once, "truth") == facts(again, "truth")


def test_nothing_is_sent_when_the_task_stops() -> None:
    task = BenchTask(BLIND)
    task.start(0)
    assert list(task.stop(100 * MS).sends) == []
