"""Status of the robot for a second terminal: stopped at rest only by phase and encoders."""

from __future__ import annotations

import struct

import msgspec
import pytest

from comms.messages import CanMessage, Command, Phase, Reply, RobotState, Verb
from comms.task import Step
from rig.run.runtime.robot_watch import JointWatch, RobotWatch
from rig.run.runtime.terminal_requests import TerminalRequests
from rig.run.tasks.drive.settings import DriveSettings, Identity
from rig.run.tasks.operator import Operator

MS = 1_000_000
NOW_NS = 900 * MS


def state(
    phase: Phase = Phase.STOPPED,
    speed_m_s: float = 0.0,
    error_m: float = 0.0,
    age_ms: int = 5,
    t_ns: int = NOW_NS,
) -> RobotState:
    """Robot state; age_ms: age of the encoder reading."""
    return RobotState(
        seq=0,
        t_ns=t_ns,
        t_actual_ns=t_ns - age_ms * MS,
        commanded_m=(0.1, 0.0, 0.0),
        actual_m=(0.1 + error_m, 0.0, 0.0),
        actual_velocity_m_s=(0.0, speed_m_s, 0.0),
        phase=phase,
    )


def reply(phase: Phase, sender: str = "controller", t_ns: int = NOW_NS) -> Reply:
    """Reply of a task."""
    return Reply(seq=0, t_ns=t_ns, id=1, sender=sender, ok=True, phase=phase)


def running_operator() -> Operator:
    """Operator of a run."""
    return Operator(["controller", "streamer"], 10**9)


def motion(speed_rad_s: float, t_ns: int = NOW_NS) -> CanMessage:
    """PDO of a joint with the speed of its motor."""
    data = struct.pack("<ii", 0, round(speed_rad_s * 1000.0))
    return CanMessage(
        seq=0, t_ns=t_ns, can_id=0x183, is_extended=False, is_remote=False, length=8, data=data
    )


@pytest.mark.parametrize(
    ("speed_rad_s", "age_ms", "is_at_rest"),
    [(0.5, 0, True), (-0.5, 0, True), (2.0, 0, False), (0.5, 10, False)],
)
def test_a_joint_is_at_rest_by_the_phase_of_its_drive_and_a_newer_speed(
    speed_rad_s: float, age_ms: int, is_at_rest: bool
) -> None:
    drive = DriveSettings(
        node_id=3,
        identity=Identity(0, 0, 0),
        increments_per_unit=1000.0,
        velocity_units_per_unit_s=1000.0,
        acceleration_units_per_unit_s2=1000.0,
    )
    watch = JointWatch(Operator(["drive", "bench"], 10**9), drive)
    watch.take_reply(reply(Phase.RUNNING, "drive", NOW_NS - 5 * MS))
    watch.take_frame(motion(0.0))
    assert not watch.status()["at_rest"]
    watch.take_reply(reply(Phase.STOPPED, "bench"))
    watch.take_reply(reply(Phase.STOPPED, "drive"))
    watch.take_frame(motion(speed_rad_s, NOW_NS - age_ms * MS))
    assert watch.status()["at_rest"] is is_at_rest
    assert watch.status()["speed_rad_s"] == speed_rad_s


def at_rest(*messages: RobotState | Reply, operator: Operator | None = None) -> bool:
    """Take messages in their order of arrival; tell if the robot is stopped at rest."""
    watch = RobotWatch(operator or running_operator())
    for message in messages:
        if isinstance(message, Reply):
            watch.take_reply(message)
        else:
            watch.take_state(message)
    return bool(watch.status()["at_rest"])


@pytest.mark.parametrize("phase", [Phase.STOPPED, Phase.FAULT])
def test_a_stopped_robot_at_its_setpoint_is_at_rest(phase: Phase) -> None:
    assert at_rest(state(phase))


@pytest.mark.parametrize(
    "seen",
    [
        pytest.param(state(Phase.RUNNING), id="running"),
        pytest.param(state(Phase.ARMED), id="armed"),
        pytest.param(state(speed_m_s=0.003), id="moving"),
        pytest.param(state(speed_m_s=-0.003), id="moving_back"),
        pytest.param(state(error_m=0.0011), id="away_from_its_setpoint"),
        pytest.param(state(age_ms=101), id="old_encoders"),
    ],
)
def test_a_robot_of_which_the_phase_or_the_encoders_do_not_say_so_is_not_at_rest(
    seen: RobotState,
) -> None:
    assert not at_rest(seen)


def test_an_encoder_reading_from_before_the_stop_does_not_count() -> None:
    standing = state(Phase.RUNNING, t_ns=NOW_NS - 50 * MS)
    assert not at_rest(standing, reply(Phase.STOPPED))
    assert at_rest(standing, reply(Phase.STOPPED), state(t_ns=NOW_NS + 5 * MS))


def test_an_older_state_that_arrives_after_the_reply_does_not_take_the_stop_back() -> None:
    older = state(Phase.RUNNING, t_ns=NOW_NS - 5 * MS)
    assert at_rest(reply(Phase.STOPPED), state(t_ns=NOW_NS + 5 * MS), older)


def test_the_phase_of_another_task_does_not_count() -> None:
    assert not at_rest(reply(Phase.STOPPED, "streamer"), state(Phase.RUNNING))


def test_nothing_known_is_not_at_rest_until_a_run_that_never_started_is_closed() -> None:
    operator = running_operator()
    assert not at_rest(operator=operator)
    operator.stop_now("stop", 4, 0)
    assert at_rest(operator=operator)


@pytest.mark.parametrize(
    ("asked", "verb", "code"), [("stop", Verb.STOP, 4), ("estop", Verb.ESTOP, 5)]
)
def test_a_stop_request_orders_it_and_names_the_stage(asked: str, verb: Verb, code: int) -> None:
    operator, steps = running_operator(), list[Step]()
    requests = TerminalRequests(operator, RobotWatch(operator), steps.append)
    assert requests.answer(asked, 0) == "ordered, was connecting"
    orders = [send.message for step in steps for send in step.sends]
    assert [order.verb for order in orders if isinstance(order, Command)] == [verb, verb]
    assert operator.exit_code == code


def test_a_status_request_changes_nothing_and_says_phase_and_speed() -> None:
    operator, steps = running_operator(), list[Step]()
    watch = RobotWatch(operator)
    watch.take_state(state(Phase.RUNNING, speed_m_s=0.25))
    answer = TerminalRequests(operator, watch, steps.append).answer("status", 0)
    assert msgspec.json.decode(answer) == {
        "stage": "connecting",
        "phase": "running",
        "speed_m_s": 0.25,
        "at_rest": False,
    }
    assert steps == []


@pytest.mark.parametrize("asked", ["arm", "start", "", "STOP"])
def test_another_request_is_refused_with_what_is_understood(asked: str) -> None:
    operator, steps = running_operator(), list[Step]()
    requests = TerminalRequests(operator, RobotWatch(operator), steps.append)
    assert requests.answer(asked, 0) == "understood are: stop, estop, status"
    assert steps == []
