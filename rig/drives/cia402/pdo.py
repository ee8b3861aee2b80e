"""Process data: reception and transmission of PDOs by event or by SYNC (CiA 301)."""

from __future__ import annotations

from rig.drives.cia402.emergency import EmergencyProducer, ErrorCode
from rig.drives.cia402.errors import SdoAbort
from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.drives.cia402.pdo_parameters import (
    EVENT_TIMER,
    INHIBIT_TIME,
    PdoParameters,
    PdoRecords,
)
from rig.drives.cia402.signals import NS_PER_MS

RPDO_COMMUNICATION = 0x1400
RPDO_MAPPING = 0x1600
TPDO_COMMUNICATION = 0x1800
TPDO_MAPPING = 0x1A00
CONTROL_WORD = 0x6040
PDO_COUNT = 4  # of each direction

NS_PER_INHIBIT_UNIT = 100_000


class ReceivePdo:
    """PDO from the master.

    A PDO that is too short, or holds a value beyond its limits, is ignored as a whole and reported
    by an emergency message. Bytes behind the mapped ones are ignored.
    """

    def __init__(
        self, dictionary: ObjectDictionary, emergency: EmergencyProducer, number: int
    ) -> None:
        """Receive RPDO number 0 to 3 and report errors to an emergency producer."""
        records = PdoRecords(RPDO_COMMUNICATION + number, RPDO_MAPPING + number, is_receive=True)
        self.parameters = PdoParameters(dictionary, records)
        self._dictionary = dictionary
        self._emergency = emergency
        self._number = number
        self._waiting: bytes | None = None

    def reset(self) -> None:
        """Drop data that wait for a SYNC."""
        self._waiting = None
        self.parameters.reset()

    def on_frame(self, frame: CanFrame) -> None:
        """Take a frame with the CAN-ID of this PDO."""
        length = self.parameters.length
        if len(frame.data) < length:
            self._emergency.report(ErrorCode.PDO_TOO_SHORT, self._number + 1)
            return
        self._emergency.clear(ErrorCode.PDO_TOO_SHORT, self._number + 1)
        if self.parameters.is_synchronous:
            self._waiting = frame.data
        else:
            self._apply(frame.data)

    def on_sync(self) -> None:
        """Make the data of the last frame valid."""
        if self._waiting is None:
            return
        data = self._waiting
        self._waiting = None
        self._apply(data)

    def _apply(self, data: bytes) -> None:
        values = self._split(data)
        try:
            for index, subindex, value in values:
                self._dictionary.decode(index, subindex, value)
        except SdoAbort:
            self._emergency.report(ErrorCode.PROTOCOL_ERROR, self._number + 1)
            return
        self._emergency.clear(ErrorCode.PROTOCOL_ERROR, self._number + 1)
        for index, subindex, value in values:
            self._dictionary.write(index, subindex, value)

    def _split(self, data: bytes) -> list[tuple[int, int, bytes]]:
        """Index, sub-index and bytes of the mapped objects, without dummies.

        The control word comes last, so that its command finds all other objects of the PDO.
        """
        values: list[tuple[int, int, bytes]] = []
        offset = 0
        for mapped in self.parameters.mapping:
            end = offset + mapped.length
            if not mapped.is_dummy:
                values.append((mapped.object_index, mapped.subindex, data[offset:end]))
            offset = end
        values.sort(key=_is_control_word)
        return values


class TransmitPdo:
    """PDO to the master."""

    def __init__(self, dictionary: ObjectDictionary, number: int) -> None:
        """Transmit TPDO number 0 to 3."""
        records = PdoRecords(TPDO_COMMUNICATION + number, TPDO_MAPPING + number, is_receive=False)
        self.parameters = PdoParameters(dictionary, records)
        self._dictionary = dictionary
        self.reset()

    def reset(self) -> None:
        """Forget what was sent: an event PDO is then sent once."""
        self._last_data: bytes | None = None
        self._last_ns: int | None = None
        self._syncs = 0
        self.parameters.reset()

    def on_sync(self, t_ns: int) -> CanFrame | None:
        """PDO due at a SYNC at t_ns [ns]: type 0 after a change, type n at every n-th SYNC."""
        if not self._is_sendable() or not self.parameters.is_synchronous:
            return None
        period = self.parameters.transmission_type
        if period == 0:
            return self._frame(t_ns) if self._data() != self._last_data else None
        self._syncs += 1
        if self._syncs < period:
            return None
        self._syncs = 0
        return self._frame(t_ns)

    def on_time(self, t_ns: int) -> CanFrame | None:
        """PDO of an event type due at t_ns [ns]: after a change, or after the event timer."""
        if not self._is_sendable() or self.parameters.is_synchronous:
            return None
        if self._last_ns is None:
            return self._frame(t_ns)
        waited_ns = t_ns - self._last_ns
        if waited_ns < self._parameter(INHIBIT_TIME) * NS_PER_INHIBIT_UNIT:
            return None
        timer_ns = self._parameter(EVENT_TIMER) * NS_PER_MS
        is_overdue = 0 < timer_ns <= waited_ns
        if is_overdue or self._data() != self._last_data:
            return self._frame(t_ns)
        return None

    def on_remote_request(self, t_ns: int) -> CanFrame | None:
        """PDO that answers a remote frame, if its COB-ID allows it."""
        if self._is_sendable() and self.parameters.allows_remote_request:
            return self._frame(t_ns)
        return None

    def _is_sendable(self) -> bool:
        return self.parameters.is_valid and bool(self.parameters.mapping)

    def _parameter(self, subindex: int) -> int:
        return self._dictionary.get(self.parameters.records.communication, subindex)

    def _data(self) -> bytes:
        parts = [
            self._dictionary.read(mapped.object_index, mapped.subindex)
            for mapped in self.parameters.mapping
        ]
        return b"".join(parts)

    def _frame(self, t_ns: int) -> CanFrame:
        self._last_data = self._data()
        self._last_ns = t_ns
        return CanFrame(self.parameters.can_id, self._last_data)


class ProcessData:
    """All PDOs of the node; they exist in the NMT state OPERATIONAL only."""

    def __init__(self, dictionary: ObjectDictionary, emergency: EmergencyProducer) -> None:
        """Create four RPDOs and four TPDOs."""
        numbers = range(PDO_COUNT)
        self.receive = [ReceivePdo(dictionary, emergency, number) for number in numbers]
        self.transmit = [TransmitPdo(dictionary, number) for number in numbers]

    def reset(self) -> None:
        """Drop pending data and forget what was sent."""
        for received in self.receive:
            received.reset()
        for transmitted in self.transmit:
            transmitted.reset()

    def on_frame(self, frame: CanFrame, t_ns: int) -> list[CanFrame]:
        """Take a frame at t_ns [ns]; return the answers to a remote frame."""
        answers: list[CanFrame] = []
        if frame.is_remote:
            for transmitted in self.transmit:
                if transmitted.parameters.can_id == frame.can_id:
                    _append(answers, transmitted.on_remote_request(t_ns))
            return answers
        for received in self.receive:
            parameters = received.parameters
            if parameters.is_valid and parameters.can_id == frame.can_id:
                received.on_frame(frame)
        return answers

    def apply_received(self) -> None:
        """Make the data of synchronous RPDOs valid at a SYNC."""
        for received in self.receive:
            received.on_sync()

    def on_sync(self, t_ns: int) -> list[CanFrame]:
        """Synchronous TPDOs due at a SYNC at t_ns [ns]."""
        frames: list[CanFrame] = []
        for transmitted in self.transmit:
            _append(frames, transmitted.on_sync(t_ns))
        return frames

    def on_time(self, t_ns: int) -> list[CanFrame]:
        """Event TPDOs due at t_ns [ns]."""
        frames: list[CanFrame] = []
        for transmitted in self.transmit:
            _append(frames, transmitted.on_time(t_ns))
        return frames


def _append(frames: list[CanFrame], frame: CanFrame | None) -> None:
    if frame is not None:
        frames.append(frame)


def _is_control_word(value: tuple[int, int, bytes]) -> bool:
    return value[0] == CONTROL_WORD
