"""Exchange with the nodes of a bus in one thread: paced requests, answers, bounded waits."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable

import can
from canopen import ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from comms.channels import MS
from comms.clock import Clock
from comms.errors import CommsError
from rig.drives.cia402.errors import AbortCode
from rig.drives.cia402.frames import SDO_REQUEST, SDO_RESPONSE

REQUEST_PERIOD_NS = MS  # shortest time between two requests: 15 % of a bus of 1 Mbit/s
RECEIVE_S = 0.05  # longest wait of one call of python-can
MAX_STALE_FRAMES = 10_000  # on a busy bus the reading of old frames ends there
ABORT = 0x80
TIMED_OUT = int(AbortCode.TIMED_OUT).to_bytes(4, "little")
NODE_MASK, FUNCTION_MASK = 0x7F, 0x780
logging.getLogger("canopen").addHandler(logging.NullHandler())  # what it logs, its errors say too


class BusFailed(CommsError):
    """Bus that cannot send or receive any more."""


class Exchange:
    """Frames of a bus, with the count of SDO requests and answers of each node.

    An answer that no request asked for is that of a second node with the same node-ID.
    """

    def __init__(self, bus: can.BusABC, clock: Clock) -> None:
        self._bus = bus
        self._clock = clock
        self._next_request_ns = 0
        self.requests: Counter[int] = Counter()  # by node-ID, those of other clients too
        self.answers: Counter[int] = Counter()
        self.on_frame: Callable[[can.Message], None] = _ignore

    def now_ns(self) -> int:
        """Time of the exchange [ns]."""
        return self._clock.now_ns()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a request, at the earliest REQUEST_PERIOD_NS after the last one.

        Raises BusFailed.
        """
        self.listen(self._next_request_ns)
        message = can.Message(
            arbitration_id=can_id, data=data, is_remote_frame=remote, is_extended_id=False
        )
        self._next_request_ns = self.now_ns() + REQUEST_PERIOD_NS
        self._count(message)
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            raise BusFailed(
                f"the bus takes no frame ({error}): look for another node, termination and bit rate"
            ) from error

    def listen(self, until_ns: int) -> None:
        """Receive until an instant."""
        while self.now_ns() < until_ns:
            self.receive(until_ns)

    def skip(self) -> None:
        """Receive what has arrived: it is no answer to the next request."""
        for _ in range(MAX_STALE_FRAMES):
            if self.receive(0) is None:
                return

    def receive(self, until_ns: int) -> can.Message | None:
        """Receive one frame, at most until an instant; raises BusFailed."""
        wait_s = max(0.0, min(RECEIVE_S, (until_ns - self.now_ns()) * 1e-9))
        try:
            message = self._bus.recv(wait_s)
        except (can.CanError, OSError) as error:
            raise BusFailed(
                f"the bus cannot be read any more ({error}): look for the device"
            ) from error
        if message is not None:
            self._count(message)
            self.on_frame(message)
        return message

    def _count(self, message: can.Message) -> None:
        if not is_plain(message):
            return
        function = message.arbitration_id & FUNCTION_MASK
        node = message.arbitration_id & NODE_MASK
        if function == SDO_REQUEST and len(message.data) and message.data[0] != ABORT:
            self.requests[node] += 1
        elif function == SDO_RESPONSE and not _is_time_out(message):
            self.answers[node] += 1


class ObjectClient(SdoClient):
    """SDO client of canopen for one node, without its thread."""

    def __init__(self, exchange: Exchange, node_id: int, timeout_s: float) -> None:
        objects = ObjectDictionary()  # type: ignore[no-untyped-call]
        super().__init__(  # type: ignore[no-untyped-call]
            SDO_REQUEST + node_id, SDO_RESPONSE + node_id, objects
        )
        self._exchange = exchange
        self.timeout_s = timeout_s
        self.network = exchange  # type: ignore[assignment]  # it sends, as a Network does

    def send_request(self, request: bytes) -> None:
        """Send a request; old frames are no answer to it."""
        self._exchange.skip()
        self._exchange.send_message(self.rx_cobid, bytes(request))

    def read_response(self) -> bytes:
        """Receive the answer; raises SdoAbortedError, and SdoCommunicationError at the time-out."""
        until_ns = self._exchange.now_ns() + round(self.timeout_s * 1e9)
        while True:
            message = self._exchange.receive(until_ns)
            if message is not None and self._is_answer(message):
                break
            if self._exchange.now_ns() >= until_ns:
                raise SdoCommunicationError("No SDO response received")
        data = bytes(message.data)
        if data[0] == ABORT:
            raise SdoAbortedError(int.from_bytes(data[4:8], "little"))
        return data

    def _is_answer(self, message: can.Message) -> bool:
        is_own = message.arbitration_id == self.tx_cobid
        return is_own and is_plain(message) and len(message.data) == 8


def is_plain(message: can.Message) -> bool:
    """Tell if a frame is a data frame in base format."""
    is_other = message.is_extended_id or message.is_remote_frame or message.is_error_frame
    return not (is_other or message.is_fd)


def _is_time_out(message: can.Message) -> bool:
    """Tell if a server gave a transfer up, which is no answer to a request."""
    data = bytes(message.data)
    return data[:1] == bytes([ABORT]) and data[4:8] == TIMED_OUT


def _ignore(message: can.Message) -> None:
    """Take no notice of a frame."""
