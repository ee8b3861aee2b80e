"""Drive profile of CiA 402: state machine, modes of operation and faults of one axis.

End switches and software limits: moving into one in any mode but homing is the fault 0x8612. A
fault brakes as 605E says; the loss of the master always brakes with the quick stop ramp. A fault
of the power stage switches off at once, since a faulty stage cannot brake.
"""

from __future__ import annotations

from rig.drives.cia402.axis import DriveAxis
from rig.drives.cia402.emergency import EmergencyProducer, ErrorCode
from rig.drives.cia402.errors import AbortCode, Cia402Error, SdoAbort
from rig.drives.cia402.modes.cyclic import CyclicPosition, CyclicTorque, CyclicVelocity
from rig.drives.cia402.modes.homing import Homing
from rig.drives.cia402.modes.mode import CONTROL_WORD, NoMode, OperatingMode
from rig.drives.cia402.modes.profile_position import ProfilePosition
from rig.drives.cia402.modes.stop import StopRamp
from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.drives.cia402.signals import (
    NS_PER_S,
    PERMILLE,
    DriveDemand,
    DriveFeedback,
    DriveUnits,
    check_feedback,
)
from rig.drives.cia402.state_machine import (
    DriveEvent,
    DriveState,
    StatusBit,
    Transition,
    compose_status_word,
    decode_control_word,
    find_transition,
)
from rig.drives.cia402.supervisor import AxisSupervisor

CONNECTION_OPTION = 0x6007
ERROR_CODE = 0x603F
STATUS_WORD = 0x6041
QUICK_STOP_OPTION = 0x605A
FAULT_OPTION = 0x605E
MODE = 0x6060
MODE_DISPLAY = 0x6061
PROFILE_DECELERATION = 0x6084
QUICK_STOP_DECELERATION = 0x6085
RATED_TORQUE = 0x6076

STOP_RAMPS = {
    1: PROFILE_DECELERATION,
    2: QUICK_STOP_DECELERATION,
    5: PROFILE_DECELERATION,
    6: QUICK_STOP_DECELERATION,
}  # by option code of 605A and 605E; 0 switches off at once
SWITCH_OFF = 0
BRAKE_QUICKLY = 2
STAYING_OPTIONS = (5, 6)  # option codes of 605A that stay in QUICK STOP ACTIVE

CONNECTION_FAULT = 1  # option codes of 6007
CONNECTION_DISABLE = 2
CONNECTION_QUICK_STOP = 3


class Cia402Drive:
    """Drive of one axis; its inputs are the objects of a dictionary and the feedback."""

    def __init__(
        self, dictionary: ObjectDictionary, emergency: EmergencyProducer, units: DriveUnits
    ) -> None:
        """Connect the drive to its dictionary and to the producer of emergency messages."""
        self.axis = DriveAxis(dictionary, units)
        self._dictionary = dictionary
        self._emergency = emergency
        self._supervisor = AxisSupervisor(self.axis)
        self._modes: dict[int, OperatingMode] = {
            0: NoMode(self.axis),
            1: ProfilePosition(self.axis),
            6: Homing(self.axis),
            8: CyclicPosition(self.axis),
            9: CyclicVelocity(self.axis),
            10: CyclicTorque(self.axis),
        }
        self._last_step_ns: int | None = None
        dictionary.add_check(MODE, self._check_mode)
        dictionary.add_action(MODE, self._on_mode)
        dictionary.add_action(CONTROL_WORD, self._on_control_word)
        self.reset()

    def reset(self) -> None:
        """Return to the state after power on: not homed, switched off, no fault."""
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self._mode = self._modes[0]
        self._control_word = 0
        self._stop: StopRamp | None = None
        self._power_fault = 0  # error code of the power stage
        self._faults: list[int] = []  # error codes to clear at a fault reset
        self.axis.reset()
        self._supervisor.reset()
        for mode in self._modes.values():
            mode.reset()
        torque = round(self.axis.units.rated_torque * PERMILLE)
        self._dictionary.set(RATED_TORQUE, torque)
        self._publish_status()

    def on_sync(self, t_ns: int) -> None:
        """Make cyclic targets valid with a SYNC at t_ns [ns]."""
        if self.state is DriveState.OPERATION_ENABLED:
            self._mode.on_sync(t_ns)

    def on_connection_lost(self) -> None:
        """React to a lost heartbeat of the master as 6007 says."""
        option = self._dictionary.get(CONNECTION_OPTION)
        if option == CONNECTION_FAULT:
            self._raise_fault(ErrorCode.HEARTBEAT_LOST, BRAKE_QUICKLY)
        elif option == CONNECTION_DISABLE:
            self._apply(DriveEvent.DISABLE_VOLTAGE)
        elif option == CONNECTION_QUICK_STOP:
            self._apply(DriveEvent.QUICK_STOP)
        self._publish_status()

    def on_control_lost(self) -> None:
        """Stop quickly after the node left the NMT state OPERATIONAL, unless 6007 is 0."""
        if self._dictionary.get(CONNECTION_OPTION) != 0:
            self._apply(DriveEvent.QUICK_STOP)
        self._publish_status()

    def step(self, t_ns: int, feedback: DriveFeedback) -> DriveDemand:
        """Compute the demand of one drive sample at t_ns [ns].

        Raises Cia402Error if t_ns is before that of the last call, or for a feedback out of range.
        """
        check_feedback(feedback)
        self.axis.measure(t_ns, self._elapsed_s(t_ns), feedback)
        self._apply(DriveEvent.INITIALISED)
        self._watch_faults()
        demand = self._demand()
        self.axis.publish_demand(demand)
        self._publish_status()
        return demand

    def _elapsed_s(self, t_ns: int) -> float:
        last_ns = t_ns if self._last_step_ns is None else self._last_step_ns
        if t_ns < last_ns:
            raise Cia402Error(
                f"t_ns = {t_ns} of a drive sample; must be >= {last_ns}, the sample before: "
                "take all times from one clock"
            )
        self._last_step_ns = t_ns
        return (t_ns - last_ns) / NS_PER_S

    def _demand(self) -> DriveDemand:
        if self.state is DriveState.OPERATION_ENABLED:
            return self._mode.step()
        if self._stop is not None and self._stop.is_finished:
            self._complete_stop()
        return self._off() if self._stop is None else self._stop.step()

    def _off(self) -> DriveDemand:
        self.axis.follow_actual()
        self._supervisor.restart()
        return self.axis.demand("off")

    def _complete_stop(self) -> None:
        """Leave the state of a stop that has ended."""
        if self.state is DriveState.FAULT_REACTION_ACTIVE:
            self._apply(DriveEvent.REACTION_COMPLETED)
        elif self._dictionary.get(QUICK_STOP_OPTION) not in STAYING_OPTIONS:
            self._apply(DriveEvent.STOP_COMPLETED)

    def _watch_faults(self) -> None:
        """Compare the measurement with the demand of the sample before."""
        self._watch_power_stage()
        if self.state not in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE):
            return
        option = self._dictionary.get(FAULT_OPTION)
        if self._mode.controls_position and self._supervisor.check_following():
            self.axis.begin_to_brake()
            self._raise_fault(ErrorCode.FOLLOWING_ERROR, option)
        elif self._is_at_limit():
            self._raise_fault(ErrorCode.REFERENCE_LIMIT, option)

    def _is_at_limit(self) -> bool:
        if self.state is not DriveState.OPERATION_ENABLED:
            return False  # it brakes already
        if self._mode.obeys_switches and self._supervisor.moves_into_switch():
            return True
        if self._mode.controls_position:
            return False
        return self._supervisor.moves_beyond_limit()

    def _watch_power_stage(self) -> None:
        code = self.axis.feedback.drive_fault
        if code and code != self._power_fault:
            self._raise_fault(code, SWITCH_OFF)
        self._power_fault = code

    def _raise_fault(self, code: int, option: int) -> None:
        """Report a fault and start the reaction of an option code of 605E."""
        self._emergency.report(code)
        self._faults.append(code)
        is_moving = self.state in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
        is_first = self._apply(DriveEvent.FAULT_DETECTED)
        if is_first:
            self._dictionary.set(ERROR_CODE, code)
        if is_first and is_moving and option != SWITCH_OFF:
            self._start_stop(STOP_RAMPS[option])
        elif is_first or option == SWITCH_OFF:
            self._apply(DriveEvent.REACTION_COMPLETED)

    def _start_stop(self, index: int) -> None:
        self._stop = StopRamp(
            self.axis,
            self.axis.acceleration_of(index),
            controls_position=self._mode.controls_position,
        )

    def _on_control_word(self, subindex: int, word: int) -> None:
        previous = self._control_word
        self._control_word = word
        event = decode_control_word(word, previous)
        if event is not None:
            self._command(event)
        if self.state is DriveState.OPERATION_ENABLED:
            self._mode.on_control_word(word, previous)
        self._publish_status()

    def _command(self, event: DriveEvent) -> None:
        """Apply a command; enable operation passes SWITCHED ON on its way."""
        is_applied = self._apply(event)
        if is_applied and event is DriveEvent.ENABLE_OPERATION:
            self._apply(event)

    def _apply(self, event: DriveEvent) -> bool:
        """Make the transition of an event; False if there is none."""
        row = find_transition(self.state, event)
        if row is None or not self._is_permitted(row):
            return False
        self.state = row.target
        self._stop = None
        if row.number == 4:
            self.axis.follow_actual()
        if row.target is DriveState.OPERATION_ENABLED:
            self._mode.enter()
        elif row.target is DriveState.QUICK_STOP_ACTIVE:
            self._start_quick_stop()
        elif row.number == 15:
            self._clear_faults()
        return True

    def _is_permitted(self, row: Transition) -> bool:
        if row.number == 15:
            return self.axis.feedback.drive_fault == 0
        if row.number == 16:
            return self._dictionary.get(QUICK_STOP_OPTION) in STAYING_OPTIONS
        return True

    def _start_quick_stop(self) -> None:
        option = self._dictionary.get(QUICK_STOP_OPTION)
        if option == SWITCH_OFF:
            self._apply(DriveEvent.STOP_COMPLETED)
        else:
            self._start_stop(STOP_RAMPS[option])

    def _clear_faults(self) -> None:
        for code in self._faults:
            self._emergency.clear(code)
        self._faults.clear()
        self._dictionary.set(ERROR_CODE, 0)
        self._supervisor.reset()

    def _check_mode(self, subindex: int, value: int) -> None:
        if value not in self._modes:
            detail = f"mode {value}, must be one of {tuple(self._modes)}: see object 6502"
            raise SdoAbort(AbortCode.INVALID_VALUE, MODE, subindex, detail)

    def _on_mode(self, subindex: int, value: int) -> None:
        self._dictionary.set(MODE_DISPLAY, value)
        if self._mode is self._modes[value]:
            return
        self._mode = self._modes[value]
        if self.state is DriveState.OPERATION_ENABLED:
            self._mode.enter()
        self._publish_status()

    def _publish_status(self) -> None:
        bits = 0
        if self.state is DriveState.OPERATION_ENABLED:
            bits = self._mode.status_bits()
        elif self._stop is not None and self._stop.is_finished:
            bits = StatusBit.TARGET_REACHED
        feedback = self.axis.feedback
        if self.axis.is_limited or feedback.negative_switch or feedback.positive_switch:
            bits |= StatusBit.LIMIT_ACTIVE
        if self._supervisor.has_following_error:
            bits |= StatusBit.MODE_BIT_13
        self._dictionary.set(STATUS_WORD, compose_status_word(self.state, bits))
